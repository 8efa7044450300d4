// The arm of the 3-D view: simple bodies, each fixed to a link, and the links in each posture.
"use strict";

const COLOURS = {
  light: { body: "#c6ced6", joint: "#5a6570", accent: "#d9782d", tool: "#8a96a3" },
  dark: { body: "#8c98a5", joint: "#48535e", accent: "#e08a45", tool: "#6f7c89" },
};
const BEVEL = 0.14; // of the radius
const NEAR = 0.02; // of an edge
const BOOM_WIDTH = 1.5; // of its thinner radius

export class RobotBody {
  // The links are (n, dof + 1, 4, 3): origin and axes in base.
  constructor(three, doc, links, sides) {
    const T = (this.T = three);
    this.links = links;
    this.shapes = doc.shapes;
    this.count = doc.links.shape[1];
    this.postures = doc.links.shape[0];
    this.group = new T.Group();
    this.parts = Array.from({ length: this.count }, () => {
      const part = new T.Group();
      part.matrixAutoUpdate = false;
      this.group.add(part);
      return part;
    });
    this.paints = Object.fromEntries(Object.keys(COLOURS.light).map((name) => [name, new T.MeshLambertMaterial()]));
    for (const shape of this.shapes) this.parts[shape.link].add(this.mesh(shape, sides));
    this.pose(0);
  }

  theme(dark) {
    for (const [name, paint] of Object.entries(this.paints)) paint.color.set(COLOURS[dark ? "dark" : "light"][name]);
  }

  pose(n) {
    const [x, y, z] = [new this.T.Vector3(), new this.T.Vector3(), new this.T.Vector3()];
    this.parts.forEach((part, k) => {
      const at = 12 * (n * this.count + k);
      part.matrix.makeBasis(x.fromArray(this.links, at + 3), y.fromArray(this.links, at + 6), z.fromArray(this.links, at + 9));
      part.matrix.setPosition(this.links[at], this.links[at + 1], this.links[at + 2]);
    });
  }

  // Origins of the links from one on in a posture, as [x, y, z, x, ...].
  origins(n, first = 0) {
    const found = [];
    for (let k = first; k < this.count; k++) {
      const at = 12 * (n * this.count + k);
      found.push(this.links[at], this.links[at + 1], this.links[at + 2]);
    }
    return found;
  }

  // Points about the base plate and the links, one radius away from their middle.
  outline() {
    const found = [];
    for (const { link, start, end, radii } of this.shapes) {
      for (const [at, r] of [[start, radii[0]], [end, radii[1]]]) {
        const [x, y, z] = new this.T.Vector3(...at).applyMatrix4(this.parts[link].matrix).toArray();
        found.push(x - r, y, z, x + r, y, z, x, y - r, z, x, y + r, z);
        if (link) found.push(x, y, z + r);
      }
    }
    return found;
  }

  mesh(shape, sides) {
    const T = this.T;
    const [a, b] = [shape.start, shape.end].map((at) => new T.Vector3(...at));
    const along = b.clone().sub(a), length = along.length();
    along.normalize();
    const make = { drum, limb, boom }[shape.kind];
    const mesh = new T.Mesh(make(T, length, ...shape.radii, sides), this.paints[shape.paint]);
    if (shape.kind === "boom") {
      const across = new T.Vector3(...shape.boom_axis);
      mesh.quaternion.setFromRotationMatrix(new T.Matrix4().makeBasis(along, across.clone().cross(along), across));
    } else mesh.quaternion.setFromUnitVectors(new T.Vector3(0, 1, 0), along);
    mesh.position.copy(a);
    return mesh;
  }
}

const lathe = (T, profile, sides) => new T.LatheGeometry(profile.map(([r, y]) => new T.Vector2(r, y)), sides);

// A cylinder along y with bevelled ends.
function drum(T, length, r0, r1, sides) {
  const cut = Math.min(BEVEL * Math.min(r0, r1), 0.4 * length);
  const points = [[0, 0], [r0 - cut, 0], [r0, cut], [r1, length - cut], [r1 - cut, length], [0, length]];
  // A corner is two points, one a little before it and one after, so that faces do not look round.
  const beside = (p, q) => p.map((v, k) => v + NEAR * (q[k] - v));
  const corners = points.flatMap((p, k) => (points[k - 1] && points[k + 1] ? [beside(p, points[k - 1]), beside(p, points[k + 1])] : [p]));
  return lathe(T, corners, sides);
}

// A cone along y with round ends about both points.
function limb(T, length, r0, r1, sides) {
  const steps = Math.max(4, sides / 4), points = [];
  for (let k = 0; k <= steps; k++) {
    const t = (k / steps) * (Math.PI / 2);
    points.push([r0 * Math.sin(t), -r0 * Math.cos(t)]);
  }
  for (let k = 0; k <= steps; k++) {
    const t = (k / steps) * (Math.PI / 2);
    points.push([r1 * Math.cos(t), length + r1 * Math.sin(t)]);
  }
  points[points.length - 1][0] = 0;
  return lathe(T, points, sides);
}

// A flat bar along x, round about both points, its width along z.
function boom(T, length, r0, r1, sides) {
  const turn = Math.acos(Math.min(Math.max((r0 - r1) / length, -1), 1));
  const outline = new T.Shape();
  outline.absarc(0, 0, r0, turn, 2 * Math.PI - turn, false);
  outline.absarc(length, 0, r1, -turn, turn, false);
  const width = BOOM_WIDTH * Math.min(r0, r1), cut = BEVEL * Math.min(r0, r1);
  const options = { depth: width - 2 * cut, bevelThickness: cut, bevelSize: cut, bevelOffset: -cut, bevelSegments: 1, curveSegments: sides / 2 };
  return new T.ExtrudeGeometry(outline, options).translate(0, 0, cut - width / 2);
}
