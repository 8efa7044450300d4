// The cell in three dimensions: what is drawn, and when. Drawn on demand only; while one turns the
// view on a slow machine the picture gets coarser, the path thinner and the arrows lose their heads,
// and all is whole again at rest.
"use strict";

import { fitCamera } from "./camera_fit.js";
import { drawBeam, drawInstruments } from "./instrument.js";
import { RobotBody } from "./robot_body.js";

const RAMP = [[47, 109, 179], [63, 167, 160], [140, 194, 106], [240, 176, 64], [216, 67, 43]].map((c) => c.map((v) => (v / 255) ** 2.2));
const REST_MS = 160;
const HELD_MS = 500; // a whole picture between two of a slow machine would make all of them late
const SLOW_MS = 50;
const COARSEST = 0.4;
const THIN_PATH = 4000;
const MOST_PASSED = 20000;
const MOST_FITTED = 2000;
const FAR = 1.8; // reaches; an instrument beyond, or in a tall picture, is drawn but does not make the arm small
const FROM = [0.75, -1.5, 0.85]; // of the arm, where it works along x

export const rampCss = "linear-gradient(90deg,#2f6db3,#3fa7a0,#8cc26a,#f0b040,#d8432b)";

export function floats(packed) {
  const text = atob(packed.f32);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  return new Float32Array(bytes.buffer);
}

function drawnInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

function ramp(t, out, at) {
  const x = Math.min(Math.max(t, 0), 1) * (RAMP.length - 1);
  const k = Math.min(Math.floor(x), RAMP.length - 2);
  for (let c = 0; c < 3; c++) out[at + c] = RAMP[k][c] + (x - k) * (RAMP[k + 1][c] - RAMP[k][c]);
}

// Lengths of (n, 3) vectors.
export function lengths(v) {
  const out = new Float32Array(v.length / 3);
  for (let i = 0; i < out.length; i++) out[i] = Math.hypot(v[3 * i], v[3 * i + 1], v[3 * i + 2]);
  return out;
}

// Some of (n, 3) points, as [x, y, z, x, ...].
function thinned(points, most) {
  const step = 3 * Math.max(1, Math.ceil(points.length / 3 / most)), found = [];
  for (let i = 0; i < points.length; i += step) found.push(points[i], points[i + 1], points[i + 2]);
  return found;
}

export function quantile(values, share) {
  const sorted = Float32Array.from(values.filter(Number.isFinite)).sort();
  return sorted.length ? sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] : 0;
}

// An arrow is its foot, its error and a scale; the scale is one number for all, so a slider costs nothing.
const SHAFT = `attribute vec3 foot; attribute vec3 error; attribute vec3 tint; uniform float scale; varying vec3 vTint;
void main(){ vTint = tint; gl_Position = projectionMatrix * modelViewMatrix * vec4(foot + position.x * scale * error, 1.0); }`;
const HEAD = `attribute vec3 foot; attribute vec3 error; attribute vec3 tint; uniform float scale; uniform float size; varying vec3 vTint;
void main(){
  vec3 d = scale * error; float l = length(d); vec3 z = l > 1e-9 ? d / l : vec3(0.0, 0.0, 1.0);
  vec3 x = normalize(abs(z.z) < 0.9 ? cross(z, vec3(0.0, 0.0, 1.0)) : cross(z, vec3(1.0, 0.0, 0.0))); vec3 y = cross(z, x);
  float s = min(size, 0.5 * l);
  vTint = tint * (0.82 + 0.18 * position.x);
  gl_Position = projectionMatrix * modelViewMatrix * vec4(foot + d + s * (0.34 * (position.x * x + position.y * y) + (position.z - 1.0) * z), 1.0);
}`;
const TINT = `varying vec3 vTint; void main(){ gl_FragColor = vec4(pow(vTint, vec3(1.0 / 2.2)), 1.0); }`;

export class SceneView {
  constructor(three, host, onPick, onHover) {
    Object.assign(this, three);
    const T = this.THREE;
    this.host = host;
    this.onPick = onPick;
    this.onHover = onHover;
    this.software = drawnInSoftware();
    // Four samples a pixel are free on a graphics card and half the time without one.
    this.renderer = new T.WebGLRenderer({ antialias: !this.software, powerPreference: "high-performance" });
    host.append(this.renderer.domElement);
    this.labels = new this.CSS2DRenderer();
    Object.assign(this.labels.domElement.style, { position: "absolute", inset: "0", pointerEvents: "none" });
    host.append(this.labels.domElement);
    this.scene = new T.Scene();
    this.camera = new T.PerspectiveCamera(38, 1, 0.02, 60);
    this.camera.up.set(0, 0, 1);
    this.controls = new this.OrbitControls(this.camera, this.renderer.domElement);
    this.controls.addEventListener("change", () => this.moved());
    this.controls.addEventListener("start", () => (this.held = this.turned = true));
    this.controls.addEventListener("end", () => {
      this.held = false;
      if (this.rest) this.moved();
    });
    this.scene.add(new T.HemisphereLight(0xffffff, 0x8a94a0, 2.2));
    const sun = new T.DirectionalLight(0xffffff, 1.9);
    sun.position.set(2, -3, 5);
    this.scene.add(sun);
    this.layers = {};
    this.coarse = 1;
    this.frames = 0;
    this.size = new ResizeObserver(() => this.resize());
    this.size.observe(host);
    this.retheme = () => this.theme();
    addEventListener("bench-theme", this.retheme);
    this.renderer.domElement.addEventListener("click", (e) => this.pick(e));
    this.renderer.domElement.addEventListener("pointermove", (e) => this.passOver(e));
    this.renderer.domElement.addEventListener("pointerleave", () => this.passOver(null));
    this.theme();
    this.resize();
  }

  dispose() {
    this.size.disconnect();
    removeEventListener("bench-theme", this.retheme);
    this.controls.dispose();
    this.renderer.dispose();
  }

  theme() {
    const css = getComputedStyle(document.documentElement);
    const dark = (this.dark = document.documentElement.dataset.theme === "dark");
    this.scene.background = new this.THREE.Color(dark ? "#161c23" : "#eef1f4");
    this.colours = {
      before: new this.THREE.Color(css.getPropertyValue("--before").trim()),
      after: new this.THREE.Color(css.getPropertyValue("--after").trim()),
      floor: new this.THREE.Color(dark ? "#2b3641" : "#cfd6dd"),
    };
    this.body?.theme(dark);
    if (this.places) this.instruments(this.places);
    this.floorMaterial?.color.copy(this.colours.floor);
    this.wanted();
  }

  resize() {
    const { clientWidth: w, clientHeight: h } = this.host;
    if (!w || !h) return;
    this.camera.aspect = w / h;
    this.camera.updateProjectionMatrix();
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2) * this.coarse);
    this.renderer.setSize(w, h);
    this.labels.setSize(w, h);
    this.look();
    this.wanted();
  }

  wanted() {
    if (this.due) return;
    this.due = true;
    requestAnimationFrame(() => {
      this.due = false;
      this.renderer.render(this.scene, this.camera);
      this.labels.render(this.scene, this.camera);
      this.frames++;
    });
  }

  // The view moves: coarser if pictures come slowly, whole again once it rests.
  moved() {
    const now = performance.now();
    const took = now - (this.last ?? now - 16);
    this.last = now;
    if (took < 2000) this.mean = 0.6 * (this.mean ?? took) + 0.4 * took;
    if (this.mean > SLOW_MS && this.coarse > COARSEST) this.sharpness(Math.max(COARSEST, this.coarse * 0.8));
    else if (this.mean > SLOW_MS) this.headless(true);
    if (this.path && !this.thin) this.thinned(true);
    clearTimeout(this.rest);
    this.rest = setTimeout(() => {
      this.rest = null;
      this.thinned(false);
      this.headless(false);
      this.sharpness(1);
    }, this.held ? HELD_MS : REST_MS);
    this.wanted();
  }

  sharpness(share) {
    if (share === this.coarse) return;
    this.coarse = share;
    this.resize();
  }

  thinned(on) {
    this.thin = on;
    if (this.path) this.path.visible = !on;
    if (this.pathThin) this.pathThin.visible = on;
    this.wanted();
  }

  // Heads have three faces each and take longer than anything else.
  headless(on) {
    for (const tips of Object.values(this.layers).map((group) => group.userData.tips)) if (tips) tips.visible = !on;
  }

  layer(name) {
    const old = this.layers[name];
    if (old) {
      this.scene.remove(old);
      old.traverse((o) => {
        o.geometry?.dispose();
        o.element?.remove();
      });
    }
    const group = new this.THREE.Group();
    this.scene.add(group);
    this.layers[name] = group;
    return group;
  }

  show(name, on) {
    if (this.layers[name]) this.layers[name].visible = on;
    this.wanted();
  }

  robot(doc) {
    const group = this.layer("robot");
    this.tools = floats(doc.tool);
    // Twice the faces are twice the time without a graphics card.
    this.body = new RobotBody(this.THREE, doc, floats(doc.links), this.software ? 16 : 36);
    this.body.theme(this.dark);
    this.triad = this.axes(0.12, "");
    this.triad.matrixAutoUpdate = false;
    group.add(this.body.group, this.triad);
    this.surroundings(doc.reach_m, doc.wrist_reach_m ?? doc.reach_m);
    this.reach = doc.reach_m;
    this.pose(0);
  }

  // Puts the arm into one of the postures that came with it.
  pose(n) {
    const T = this.THREE;
    this.body.pose(n);
    const t = 12 * n;
    this.triad.matrix.makeBasis(
      new T.Vector3().fromArray(this.tools, t + 3), new T.Vector3().fromArray(this.tools, t + 6), new T.Vector3().fromArray(this.tools, t + 9));
    this.triad.matrix.setPosition(this.tools[t], this.tools[t + 1], this.tools[t + 2]);
    this.wanted();
  }

  instruments(places) {
    this.places = places;
    drawInstruments(this.THREE, this.layer("tracker"), places, this.dark);
  }

  axes(size, name) {
    const T = this.THREE;
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.Float32BufferAttribute([0, 0, 0, size, 0, 0, 0, 0, 0, 0, size, 0, 0, 0, 0, 0, 0, size], 3));
    geometry.setAttribute("color", new T.Float32BufferAttribute([0.8, 0.1, 0.1, 0.8, 0.1, 0.1, 0.1, 0.6, 0.15, 0.1, 0.6, 0.15, 0.15, 0.3, 0.9, 0.15, 0.3, 0.9], 3));
    const lines = new T.LineSegments(geometry, new T.LineBasicMaterial({ vertexColors: true }));
    const group = new T.Group();
    group.add(lines);
    if (name) {
      const text = document.createElement("div");
      text.className = "scene-label";
      text.textContent = name;
      const label = new this.CSS2DObject(text);
      label.position.set(0, 0, size * 0.35);
      group.add(label);
    }
    return group;
  }

  frameAxes(list) {
    const group = this.layer("frames");
    for (const { name, T_base_frame: m } of list) {
      const axes = this.axes(0.22, name);
      axes.matrixAutoUpdate = false;
      axes.matrix.set(...m.flat());
      group.add(axes);
    }
  }

  // Floor and reach: where the arm stands, and how far its wrist gets.
  surroundings(reach, wrist) {
    const T = this.THREE;
    const group = this.layer("reach");
    const points = [];
    const step = reach > 1 ? 0.5 : 0.25;
    const far = Math.ceil((reach * 1.25) / step) * step;
    for (let x = -far; x <= far + 1e-9; x += step) points.push(x, -far, 0, x, far, 0, -far, x, 0, far, x, 0);
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.Float32BufferAttribute(points, 3));
    this.floorMaterial = new T.LineBasicMaterial({ color: this.colours.floor });
    group.add(new T.LineSegments(geometry, this.floorMaterial));
    const ring = [];
    for (let k = 0; k <= 96; k++) ring.push(wrist * Math.cos((k / 48) * Math.PI), wrist * Math.sin((k / 48) * Math.PI), 0);
    const round = new T.BufferGeometry();
    round.setAttribute("position", new T.Float32BufferAttribute(ring, 3));
    const line = new T.Line(round, new T.LineDashedMaterial({ color: 0x8895a3, dashSize: 0.06, gapSize: 0.05 }));
    line.computeLineDistances();
    group.add(line);
  }

  // Looks at arm, points and instruments from the side the arm works on, wherever about its base
  // that is; of a path at the path and the wrist. Until somebody turns the view.
  look() {
    if (this.turned || !this.body) return;
    let x = 0, y = 0;
    const postures = this.tools.length / 12;
    for (let t = 0; t < this.tools.length; t += 12) {
      x += this.tools[t] / postures;
      y += this.tools[t + 1] / postures;
    }
    const turn = Math.hypot(x, y) > 0.1 * this.reach ? Math.atan2(y, x) : 0;
    const towards = new this.THREE.Vector3(...FROM).normalize().applyAxisAngle(this.camera.up, turn);
    const [place] = this.places ?? [];
    // An instrument between arm and camera would hide both: look from the other side.
    if (place && place[1] * Math.cos(turn) - place[0] * Math.sin(turn) < 0) towards.set(FROM[0], -FROM[1], FROM[2]).normalize().applyAxisAngle(this.camera.up, turn);
    const seen = [...this.body.origins(0, this.path ? this.body.count - 3 : 0), ...this.tools.slice(0, 3)];
    if (!this.path) {
      seen.push(...this.body.outline());
      const near = this.camera.aspect < 1 ? [] : (this.places ?? []).filter((at) => Math.hypot(...at) < FAR * this.reach);
      for (const at of near) seen.push(...at, at[0], at[1], at[2] - 1.2);
    }
    for (const p of thinned(this.pickable?.points ?? [], MOST_FITTED)) seen.push(p);
    this.controls.target.copy(fitCamera(this.THREE, this.camera, seen, towards, this.path ? 0.4 : 0.6 * this.reach));
    this.controls.update();
    this.wanted();
  }

  // Arrows from (n, 3) points along (n, 3) errors in m; by length on the ramp, or all in one colour.
  arrows(name, points, errors, { top, colour }) {
    const T = this.THREE;
    const group = this.layer(name);
    const n = points.length / 3;
    const tint = new Float32Array(3 * n);
    const size = lengths(errors);
    for (let i = 0; i < n; i++) {
      if (colour) this.colours[colour].toArray(tint, 3 * i);
      else ramp(size[i] / top, tint, 3 * i);
    }
    const uniforms = (this.scaleUniforms ??= { scale: { value: 100 }, size: { value: 0.028 } });
    // One vertex buffer for all arrows: drawn in software, instances cost more than their vertices.
    const spread = (corners, index) => {
      const k = corners.length / 3;
      const own = { position: new Float32Array(3 * k * n), foot: new Float32Array(3 * k * n), error: new Float32Array(3 * k * n), tint: new Float32Array(3 * k * n) };
      const indices = new Uint32Array(index.length * n);
      for (let i = 0; i < n; i++) {
        for (let c = 0; c < k; c++) {
          const at = 3 * (k * i + c);
          for (let a = 0; a < 3; a++) {
            own.position[at + a] = corners[3 * c + a];
            own.foot[at + a] = points[3 * i + a];
            own.error[at + a] = errors[3 * i + a];
            own.tint[at + a] = tint[3 * i + a];
          }
        }
        for (let c = 0; c < index.length; c++) indices[index.length * i + c] = k * i + index[c];
      }
      const geometry = new T.BufferGeometry();
      for (const [key, values] of Object.entries(own)) geometry.setAttribute(key, new T.BufferAttribute(values, 3));
      geometry.setIndex(new T.BufferAttribute(indices, 1));
      return geometry;
    };
    const material = (vertexShader) => new T.ShaderMaterial({ uniforms, vertexShader, fragmentShader: TINT, side: T.DoubleSide });
    const lines = new T.LineSegments(spread([0, 0, 0, 1, 0, 0], [0, 1]), material(SHAFT));
    const tips = new T.Mesh(spread([1, 0, 0, -0.5, 0.87, 0, -0.5, -0.87, 0, 0, 0, 1], [0, 1, 3, 1, 2, 3, 2, 0, 3]), material(HEAD));
    for (const each of [lines, tips]) {
      each.frustumCulled = false;
      group.add(each);
    }
    group.userData.tips = tips;
    this.pickable = { points, errors };
    this.wanted();
  }

  scale(factor) {
    if (this.scaleUniforms) this.scaleUniforms.scale.value = factor;
    this.wanted();
  }

  // Squares at (n, 3) points, coloured by one value each.
  field(points, values, top, width) {
    const T = this.THREE;
    const group = this.layer("field");
    const tint = new Float32Array(points.length);
    for (let i = 0; i < values.length; i++) ramp(values[i] / top, tint, 3 * i);
    const geometry = new T.BufferGeometry();
    geometry.setAttribute("position", new T.BufferAttribute(points, 3));
    geometry.setAttribute("color", new T.BufferAttribute(tint, 3));
    group.add(new T.Points(geometry, new T.PointsMaterial({ vertexColors: true, size: width, transparent: true, opacity: 0.62 })));
    this.wanted();
  }

  // A tool path of (n, 3) points, coloured by one value each; while the view moves, every so manieth.
  toolPath(points, values, top) {
    const T = this.THREE;
    const group = this.layer("path");
    const n = points.length / 3;
    const tint = new Float32Array(points.length);
    for (let i = 0; i < n; i++) ramp(values[i] / top, tint, 3 * i);
    const line = (index) => {
      const geometry = new T.BufferGeometry();
      geometry.setAttribute("position", new T.BufferAttribute(points, 3));
      geometry.setAttribute("color", new T.BufferAttribute(tint, 3));
      if (index) geometry.setIndex(index);
      const made = new T.Line(geometry, new T.LineBasicMaterial({ vertexColors: true }));
      group.add(made);
      return made;
    };
    this.path = line(null);
    this.pathThin = null;
    if (n > THIN_PATH) {
      const index = [];
      for (let i = 0; i < n; i += Math.ceil(n / THIN_PATH)) index.push(i);
      this.pathThin = line(index);
      this.pathThin.visible = false;
    }
    this.pickable = { points, errors: null };
    this.wanted();
  }

  pick(event) {
    const best = this.nearest(event, 22);
    if (best >= 0) this.onPick(best);
  }

  // Says which point the pointer passes over; not while the view turns, and not of long paths.
  passOver(event) {
    if (!this.pickable || !this.onHover || this.passing || this.held || this.pickable.points.length > 3 * MOST_PASSED) return;
    this.passing = true;
    requestAnimationFrame(() => {
      this.passing = false;
      const best = event ? this.nearest(event, 10) : -1;
      if (best === (this.passed ?? -1)) return;
      this.passed = best;
      this.onHover(best < 0 ? null : best);
    });
  }

  // The point nearest to the pointer within some pixels; -1: none.
  nearest(event, within) {
    if (!this.pickable) return -1;
    const box = this.renderer.domElement.getBoundingClientRect();
    const v = new this.THREE.Vector3();
    const { points } = this.pickable;
    let best = -1, least = within;
    for (let i = 0; i < points.length / 3; i++) {
      v.fromArray(points, 3 * i).project(this.camera);
      const d = Math.hypot(((v.x + 1) / 2) * box.width + box.left - event.clientX, ((1 - v.y) / 2) * box.height + box.top - event.clientY);
      if (v.z < 1 && d < least) [best, least] = [i, d];
    }
    return best;
  }

  // Points without errors, and thin lines of sight to where they are seen from, if that is known.
  dots(name, points, seenFrom) {
    const T = this.THREE;
    const group = this.layer(name);
    const n = points.length / 3;
    const balls = new T.InstancedMesh(new T.SphereGeometry(0.013, 12, 8), new T.MeshLambertMaterial({ color: this.colours.after }), n);
    const m = new T.Matrix4();
    for (let i = 0; i < n; i++) balls.setMatrixAt(i, m.makeTranslation(points[3 * i], points[3 * i + 1], points[3 * i + 2]));
    balls.frustumCulled = false;
    group.add(balls);
    if (seenFrom) {
      const ends = [];
      for (let i = 0; i < n; i++) ends.push(...seenFrom, points[3 * i], points[3 * i + 1], points[3 * i + 2]);
      const geometry = new T.BufferGeometry();
      geometry.setAttribute("position", new T.Float32BufferAttribute(ends, 3));
      group.add(new T.LineSegments(geometry, new T.LineBasicMaterial({ color: 0x8895a3, transparent: true, opacity: 0.35 })));
    }
    this.pickable = { points, errors: null };
    this.wanted();
  }

  mark(i) {
    this.ball("mark", i, 0xff2d78);
  }

  // Marks the point under the pointer; null: none is.
  hover(i) {
    if (i === null || !this.pickable || 3 * i + 2 >= this.pickable.points.length) this.show("hover", false);
    else this.ball("hover", i, 0xffffff);
  }

  ball(name, i, colour) {
    const T = this.THREE;
    const group = this.layer(name);
    if (name === "mark" && this.places) drawBeam(T, group, this.places, this.pickable.points.slice(3 * i, 3 * i + 3));
    const ball = new T.Mesh(new T.SphereGeometry(0.016, 16, 12), new T.MeshBasicMaterial({ color: colour, depthTest: false }));
    ball.renderOrder = 9;
    ball.position.fromArray(this.pickable.points, 3 * i);
    group.add(ball);
    this.wanted();
  }
}
