// A cell from the robot's type and a few numbers: its cell.toml is shown while one types, then kept.
const AXES = ["x", "y", "z"];
const MOST_BOXES = 8;
const point = (name) => AXES.map((axis) => `${name}_${axis}_mm`);
const GROUPS = [["tool", ["tool_x_mm", "tool_y_mm", "tool_z_mm", "tool_a_deg", "tool_b_deg", "tool_c_deg"]], ["load", ["mass_kg", "centre_x_mm", "centre_y_mm", "centre_z_mm"]], ["instrument", ["repeatability_mm", "sigma_um", "sigma_um_per_m"]]];

export default {
  template: `
  <form class="columns cell-form" @submit.prevent="keep" data-testid="cell-form">
    <div class="card">
      <h2>{{ text.form_title }}</h2>
      <label class="field">{{ text.name }}<input type="text" maxlength="200" v-model="name" :placeholder="robot" data-testid="cell-name"></label>
      <label class="field">{{ text.robot }}<select v-model="robot" data-testid="cell-robot" :aria-invalid="!!told('robot')">
        <option v-for="p in presets" :key="p.name" :value="p.name">{{ p.name }} · {{ p.joints }} {{ text.joints }} · {{ say('reach', {reach: (p.reach_mm / 1000).toFixed(2)}) }}{{ p.rated_kg ? ' · ' + p.rated_kg + ' kg' : '' }}</option></select>
        <span class="wrong" v-if="told('robot')">{{ told('robot') }}</span></label>
      <template v-for="[group, names] in groups" :key="group">
        <h3>{{ text['group_' + group] }}</h3>
        <label class="field" v-if="group === 'instrument'">{{ text.frame }}<select v-model="frame" data-testid="cell-frame"><option value="base">{{ text.frame_base }}</option><option value="unknown">{{ text.frame_unknown }}</option></select></label>
        <div class="fields" :class="'of-' + group"><label class="field" v-for="key in names" :key="key">{{ text[key] }}
          <input type="text" inputmode="decimal" v-model="numbers[key]" :placeholder="usual(key)" :aria-invalid="!!told(key)" :data-testid="'cell-' + key" autocomplete="off">
          <span class="wrong" v-if="told(key)" :data-testid="'wrong-' + key">{{ told(key) }}</span>
          <span class="careful" v-else-if="careful(key)">{{ careful(key) }}</span></label></div>
      </template>
      <details v-for="[group, names] in optional" :key="group" :data-testid="'group-' + group" :open="names.some(told) || undefined"><summary>{{ text['group_' + group] }}</summary>
        <p class="note">{{ text['hint_' + group] }}</p>
        <div class="fields"><label class="field" v-for="key in names" :key="key">{{ label(key) }}
          <input type="text" inputmode="decimal" v-model="numbers[key]" :aria-invalid="!!told(key)" :data-testid="'cell-' + key" autocomplete="off">
          <span class="wrong" v-if="told(key)" :data-testid="'wrong-' + key">{{ told(key) }}</span></label></div>
        <button type="button" class="act quiet" v-if="group === 'surroundings' && boxes < mostBoxes" @click="boxes++" data-testid="add-box">{{ text.add_box }}</button>
      </details>
    </div>
    <div class="card"><h2>cell.toml</h2><p class="note">{{ text.preview_text }}</p>
      <pre class="toml" data-testid="cell-preview">{{ shown }}</pre>
      <div class="card fault" v-if="fault" role="alert" data-testid="cell-fault" v-html="said(fault)"></div>
      <button class="act" :disabled="busy || !ready" data-testid="cell-keep">{{ text.keep }}</button></div>
  </form>`,
  props: { text: Object },
  data: () => ({ groups: GROUPS, presets: [], fields: {}, robot: "", frame: "base", name: "", numbers: {}, boxes: 0, mostBoxes: MOST_BOXES, faults: {}, cautions: {}, shown: "", ready: false, busy: false, fault: null }),
  computed: {
    typed() { return JSON.stringify([this.robot, this.frame, this.numbers]); },
    optional() {
      const joints = this.presets.find((p) => p.name === this.robot)?.joints ?? 0;
      const boxes = Array.from({ length: this.boxes }, (_, k) => ["low", "high"].flatMap((corner) => point(`box${k + 1}_${corner}`)));
      return [
        ["reflector", point("reflector")],
        ["tracker", point("tracker")],
        ["surroundings", ["floor_z_mm", ...boxes.flat()]],
        ["stiffness", Array.from({ length: joints }, (_, k) => `stiffness_${k + 1}_MNm_per_rad`)],
      ];
    },
  },
  watch: { typed() { this.ready = false; clearTimeout(this.timer); this.timer = setTimeout(this.look, 250); } },
  async mounted() {
    const found = await (await fetch("/api/presets")).json();
    this.presets = found.presets;
    this.fields = Object.fromEntries(found.fields.map((f) => [f.name, f]));
    this.robot = this.presets[0].name;
  },
  beforeUnmount() { clearTimeout(this.timer); },
  methods: {
    said: (fault) => window.bench.fault(fault),
    label(key) {
      const box = key.match(/^box(\d+)_(low|high)_(\w)_mm$/), joint = key.match(/^stiffness_(\d+)_/);
      if (box) return this.say("box_" + box[2], { number: box[1], axis: box[3] });
      return joint ? this.say("stiffness_joint", { number: joint[1] }) : this.text[key] ?? key.match(/_(\w)_mm$/)[1] + " mm";
    },
    usual(key) { return this.fields[key]?.usual != null ? String(Number(this.fields[key].usual.toFixed(6))) : ""; },
    say(key, values) { return this.text[key].replace(/\{(\w+)\}/g, (_, name) => values[name]); },
    told(key) { const f = this.faults[key]; return f ? f.text ?? this.say("wrong_" + f.kind, f) : ""; },
    careful(key) { const c = this.cautions[key]; return c ? this.say("careful_" + c.kind, c) : ""; },
    async look() {
      const asked = this.typed;
      const answer = await fetch("/api/cells/form", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ robot: this.robot, frame: this.frame, numbers: this.numbers }) });
      const found = await answer.json();
      if (asked !== this.typed) return;
      this.fault = answer.ok ? null : found;
      this.faults = found.faults ?? {};
      this.cautions = found.cautions ?? {};
      if (found.text) this.shown = found.text;
      this.ready = answer.ok && !!found.text;
    },
    async keep() {
      this.busy = true;
      try {
        const made = await window.bench.ask("POST", "/api/cells/text", { text: this.shown, name: this.name.trim() || this.robot });
        location.href = `/cell?cell=${made.id}`;
      } catch (cause) {
        this.fault = cause;
        this.busy = false;
      }
    },
  },
};
