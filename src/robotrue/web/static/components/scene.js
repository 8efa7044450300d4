// The 3-D view as an element of a page: fetches what is to be seen, and the controls beside it.
import * as three from "../three/index.js";
import { drawObstacles } from "../obstacles.js";

const UNITS = { mm: 1e3, um: 1e6 };
const STEPS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];
const ARROW = 0.5; // m, length of a large error as drawn

export default {
  template: `
  <div class="scene" data-testid="scene" :data-state="state">
    <div class="scene-canvas" ref="host"></div>
    <div class="scene-wait" v-if="state === 'loading'">{{ text.loading }}</div>
    <div class="scene-wait bad" v-if="state === 'fault'"><b>{{ text.fault }}</b><div v-html="fault"></div></div>
    <div class="scene-tools" v-if="state === 'ready'">
      <div class="seg" v-if="hasErrors || compared" role="radiogroup">
        <button v-for="w in ['before','after']" :key="w" :class="{on: which === w}" :data-testid="'show-' + w" @click="which = w">{{ text[w] }}</button>
      </div>
      <label v-if="hasErrors" class="slide">{{ text.scale }} <b>×{{ steps[scale] }}</b>
        <input type="range" min="0" :max="steps.length - 1" v-model.number="scale" data-testid="scale"></label>
      <div class="note" v-if="hasField">{{ text.field }}</div>
      <div class="seg" v-if="hasField">
        <button v-for="f in ['none','error','bound']" :key="f" :class="{on: field === f}" :data-testid="'field-' + f" @click="field = f">{{ text['field_' + f] }}</button>
      </div>
      <div class="checks">
        <label v-for="l in layers" :key="l"><input type="checkbox" :checked="visible[l]" :data-testid="'layer-' + l" @change="toggle(l)">{{ text['layer_' + l] }}</label>
      </div>
    </div>
    <div class="scene-legend" v-if="state === 'ready' && (hasErrors || hasPath || field !== 'none')">
      <span class="simulated" v-if="simulated">{{ text.simulated }}</span>
      <span v-if="hasPath">{{ text.expected }}</span><span>0</span><i :style="{background: ramp}"></i><span>{{ shown(top) }} {{ unitName }}</span>
    </div>
    <div class="scene-pick" v-if="picked !== null" data-testid="picked">
      <button class="tool" @click="unpick">×</button>
      <h3>{{ hasPath ? text.line : text.point }} {{ rowOf(picked) }}</h3>
      <dl class="facts"><template v-for="f in facts" :key="f[0]"><dt>{{ f[0] }}</dt><dd>{{ f[1] }}</dd></template></dl>
    </div>
  </div>`,
  props: { src: String, text: Object, unit: String, angles: String, letters: String },
  data: () => ({
    state: "loading", fault: "", which: "before", scale: 6, field: "none", steps: STEPS, ramp: "",
    hasErrors: false, hasField: false, hasPath: false, compared: false, simulated: false, picked: null, facts: [], top: 0,
    layers: ["robot", "reach", "frames"], visible: { robot: true, reach: true, frames: true },
  }),
  computed: {
    unitName() { return this.unit === "um" ? "µm" : "mm"; },
  },
  watch: {
    which() {
      if (this.hasErrors) this.suit();
      this.drawErrors();
      this.describe();
    },
    scale(k) { this.view.scale(STEPS[k]); },
    field() { this.drawField(); },
  },
  async mounted() {
    this.onSelect = (e) => this.pick(e.detail);
    addEventListener("bench-select", this.onSelect);
    this.onHover = (e) => this.view?.hover(e.detail);
    addEventListener("bench-hover", this.onHover);
    try {
      const tools = await import("../scene_view.js");
      const response = await fetch(this.src);
      const doc = await response.json();
      if (!response.ok) throw doc;
      this.tools = tools;
      this.ramp = tools.rampCss;
      this.build(doc.scene ?? doc, tools);
      this.state = "ready";
      window.benchScene = this.view;
    } catch (cause) {
      this.fault = window.bench.fault(cause);
      this.state = "fault";
    }
  },
  beforeUnmount() {
    removeEventListener("bench-select", this.onSelect);
    removeEventListener("bench-hover", this.onHover);
    this.view?.dispose();
  },
  methods: {
    build(doc, tools) {
      // Kept out of Vue's data: a proxy around every float would be slow.
      this.view = new tools.SceneView(three, this.$refs.host, (i) => this.pick(i, true), (i) => dispatchEvent(new CustomEvent("bench-hover", { detail: i })));
      this.simulated = Boolean(doc.model?.simulated || doc.simulated);
      this.view.robot(doc.robot);
      if (doc.trackers?.length) {
        this.view.instruments(doc.trackers);
        this.layers.push("tracker");
        this.visible.tracker = true;
      }
      this.view.frameAxes(doc.frames ?? []);
      if (doc.obstacles?.length) {
        drawObstacles(three, this.view.layer("obstacles"), doc.obstacles);
        this.layers.push("obstacles");
        this.visible.obstacles = true;
      }
      if (doc.points) {
        const p = doc.points;
        this.points = { at: tools.floats(p.position), before: p.before && tools.floats(p.before), after: p.after && tools.floats(p.after), seenFrom: p.seen_from, axes: tools.floats(p.axes_deg), row: p.row, dof: doc.robot.dof, turn: tools.floats(doc.robot.orientation[this.angles]), terms: doc.robot.orientation[this.angles].shape[1] };
        this.hasErrors = Boolean(p.before);
      }
      if (doc.path) {
        const p = doc.path;
        const bound = tools.floats(p.bound_m), expected = (error) => error.map((e, i) => e + bound[i]);
        this.postureOf = new Map(p.posture.map((point, k) => [point, k]));
        this.path = { at: tools.floats(p.position), before: expected(tools.floats(p.before_m)), after: expected(tools.floats(p.after_m)), tolerance: p.tolerance_m, line: p.line };
        this.hasPath = true;
        this.compared = p.compared;
        if (p.compared) this.which = "after";
      }
      if (doc.field) {
        this.fieldData = { at: tools.floats(doc.field.position), error: tools.floats(doc.field.error_m), bound: tools.floats(doc.field.bound_m), width: 0.8 * Math.min(...doc.field.cell_m) };
        this.hasField = true;
      }
      if (this.hasErrors) this.suit();
      this.drawErrors();
      this.view.scale(STEPS[this.scale]);
      this.view.look();
    },
    // A magnification at which the arrows can be seen; errors after are smaller than those before.
    suit() {
      const longest = this.tools.quantile(this.tools.lengths(this.points[this.which]), 0.98) || 1e-6;
      const wanted = ARROW / longest;
      this.scale = Math.max(0, STEPS.findLastIndex((step) => step <= wanted));
    },
    drawErrors() {
      if (!this.view) return;
      const { lengths, quantile } = this.tools;
      if (this.points && !this.hasErrors) this.view.dots("arrows", this.points.at, this.points.seenFrom);
      else if (this.points) {
        this.top = quantile(lengths(this.points.before), 0.98) || 1e-6; // one scale for before and after
        this.view.arrows("arrows", this.points.at, this.points[this.which], { top: this.top });
      } else if (this.path) {
        this.top = this.path.tolerance ?? (quantile(this.path.before, 0.995) || 1e-6);
        this.view.toolPath(this.path.at, this.path[this.which], this.top);
      }
    },
    drawField() {
      const values = this.fieldData[this.field];
      if (!values) {
        this.view.show("field", false);
        this.drawErrors();
        return;
      }
      this.top = this.tools.quantile(values, 0.98) || 1e-6;
      this.view.field(this.fieldData.at, values, this.top, this.fieldData.width);
      if (this.hasErrors) this.view.arrows("arrows", this.points.at, this.points[this.which], { top: this.top });
    },
    toggle(name) {
      this.visible[name] = !this.visible[name];
      this.view.show(name, this.visible[name]);
    },
    shown(length) {
      const value = length * UNITS[this.unit];
      return this.unit === "um" ? value.toFixed(0) : value.toFixed(3);
    },
    rowOf(i) {
      return this.points ? this.points.row[i] : this.path.line[i];
    },
    pick(i, told) {
      if (!this.view || i === null || i < 0) return;
      this.picked = i;
      this.view.mark(i);
      if (this.points) this.view.pose(i);
      else if (this.postureOf?.has(i)) this.view.pose(this.postureOf.get(i));
      this.describe();
      if (told) dispatchEvent(new CustomEvent("bench-picked", { detail: i }));
    },
    unpick() {
      this.picked = null;
      this.view.show("mark", false);
    },
    describe() {
      if (this.picked === null) return;
      const i = this.picked, source = this.points ?? this.path;
      const mm = (k) => (1e3 * source.at[3 * i + k]).toFixed(1);
      const facts = [["x, y, z", `${mm(0)}, ${mm(1)}, ${mm(2)} mm`]];
      if (this.points) {
        const { turn, terms } = this.points, digits = terms === 4 || this.angles === "ur" ? 4 : 2;
        facts.push([this.letters, [...turn.slice(terms * i, terms * (i + 1))].map((v) => v.toFixed(digits)).join(", ")]);
      }
      for (const w of this.hasErrors || this.path ? ["before", "after"] : []) {
        const value = this.points ? Math.hypot(...source[w].slice(3 * i, 3 * i + 3)) : source[w][i];
        facts.push([this.path ? `${this.text[w]}, ${this.text.expected}` : this.text[w], Number.isFinite(value) ? `${this.shown(value)} ${this.unitName}` : "–"]);
      }
      if (this.points) {
        const d = this.points.dof;
        facts.push([`A1 – A${d}`, [...this.points.axes.slice(d * i, d * i + d)].map((q) => q.toFixed(1)).join(", ") + "°"]);
      }
      this.facts = facts;
    },
  },
};
