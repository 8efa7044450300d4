// Where something lies: anywhere, in a box or in a sector of a ring, or where a program works.
const SHAPES = { box: ["x_mm", "y_mm", "z_mm"], ring: ["angle_deg", "radius_mm", "height_mm"] };

export default {
  template: `
  <div class="region">
    <label class="field">{{ text.title }}
      <select v-model="kind" :data-testid="name + '-kind'">
        <option v-for="k in kinds" :key="k" :value="k">{{ text[k] }}</option>
      </select></label>
    <div class="ranges" v-if="shapes[kind]">
      <template v-for="axis in shapes[kind]" :key="axis">
        <span class="note">{{ text[axis] }}</span>
        <input type="number" step="any" required v-model="low[axis]" :aria-label="text[axis]" :data-testid="name + '-' + axis + '-low'">
        <span class="note">…</span>
        <input type="number" step="any" required v-model="high[axis]" :aria-label="text[axis]" :data-testid="name + '-' + axis + '-high'">
      </template>
      <input type="hidden" :name="name" :value="stated">
    </div>
    <label class="field" v-if="kind === 'program'">{{ text.which }}
      <select name="program"><option v-for="p in programs" :key="p.id" :value="p.id">{{ p.name }}</option></select></label>
  </div>`,
  props: { name: String, text: Object, programs: Array },
  data: () => ({ kind: "any", low: {}, high: {}, shapes: SHAPES }),
  computed: {
    kinds() { return ["any", "box", "ring", ...(this.programs.length ? ["program"] : [])]; },
    stated() { return SHAPES[this.kind].map((a) => `${a}=${this.low[a] ?? ""}..${this.high[a] ?? ""}`).join(","); },
  },
};
