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
      <label class="field">{{ text.name }}<input type="text" maxlength="200" v-model="name" :placeholder="robot || arm?.name" data-testid="cell-name"></label>
      <label class="field">{{ text.robot }}<select v-model="robot" data-testid="cell-robot" :aria-invalid="!!told('robot')">
        <option v-for="p in presets" :key="p.name" :value="p.name">{{ p.name }} · {{ p.joints }} {{ text.joints }} · {{ say('reach', {reach: (p.reach_mm / 1000).toFixed(2)}) }}{{ p.rated_kg ? ' · ' + p.rated_kg + ' kg' : '' }}</option>
        <option value="">{{ text.arm_file }}</option></select>
        <span class="wrong" v-if="told('robot') && robot">{{ told('robot') }}</span></label>
      <div v-if="robot === ''" class="fields arm-file">
        <label class="field arm-choice">{{ text.arm_choose }}<input type="file" accept=".toml,.csv,.tsv,.txt,.xlsx,.ods,.urdf,.xml,.yaml,.yml" @change="sendArm" data-testid="cell-arm" :aria-invalid="!!told('arm')">
          <span class="note">{{ text.arm_hint }}</span><span class="wrong" v-if="told('arm')" data-testid="wrong-arm">{{ told('arm') }}</span></label>
        <label class="field" v-if="isTable">{{ text.arm_convention }}<select v-model="convention" data-testid="cell-convention"><option value="dh">{{ text.arm_dh }}</option><option value="mdh">{{ text.arm_mdh }}</option></select></label>
        <label class="field">{{ text.arm_maker }}<select v-model="maker" data-testid="cell-maker"><option value="">{{ text.arm_maker_none }}</option><option v-for="m in makers" :key="m" :value="m">{{ m }}</option></select></label>
      </div>
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
        <div class="fields" v-for="row in rows(names)" :key="row[0]"><label class="field" v-for="key in row" :key="key">{{ label(key) }}
          <input type="text" inputmode="decimal" v-model="numbers[key]" :aria-invalid="!!told(key)" :data-testid="'cell-' + key" autocomplete="off">
          <span class="wrong" v-if="told(key)" :data-testid="'wrong-' + key">{{ told(key) }}</span></label></div>
        <button type="button" class="act quiet" v-if="group === 'surroundings' && boxes < mostBoxes" @click="boxes++" data-testid="add-box">{{ text.add_box }}</button>
      </details>
    </div>
    <div class="card"><h2>cell.toml</h2><p class="note">{{ text.preview_text }}</p>
      <pre class="toml" tabindex="0" data-testid="cell-preview">{{ shown }}</pre>
      <div class="card fault" v-if="fault" role="alert" data-testid="cell-fault" v-html="said(fault)"></div>
      <button class="act" :disabled="busy || !ready" data-testid="cell-keep">{{ text.keep }}</button></div>
  </form>`,
  props: { text: Object },
  data: () => ({ groups: GROUPS, presets: [], fields: {}, robot: null, arm: null, armFiles: [], armJoints: 0, convention: "dh", maker: "", makers: [], frame: "base", name: "", numbers: {}, boxes: 0, mostBoxes: MOST_BOXES, faults: {}, cautions: {}, shown: "", ready: false, busy: false, fault: null }),
  computed: {
    typed() { return JSON.stringify([this.robot, this.frame, this.numbers, this.arm?.id, this.convention, this.maker]); },
    isTable() { return this.arm && !/\.(toml|urdf|xml|ya?ml)$/i.test(this.arm.name); },
    optional() {
      const joints = this.presets.find((p) => p.name === this.robot)?.joints ?? this.armJoints;
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
    this.makers = found.makers;
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
    // Three of a point to a line, so that the corners of a box stand below each other.
    rows(names) {
      const rows = [];
      for (const key of names) {
        const first = !/_[yz]_mm$/.test(key) || key === "floor_z_mm";
        if (rows.length && (!first || key.startsWith("stiffness"))) rows.at(-1).push(key);
        else rows.push([key]);
      }
      return rows;
    },
    async sendArm(e) {
      const file = e.target.files[0];
      if (!file) return;
      try {
        const sent = await window.bench.send(`/api/files?name=${encodeURIComponent(file.name)}`, file, () => {});
        this.arm = { id: sent.id, name: file.name };
      } catch (cause) {
        this.fault = cause;
      }
    },
    async look() {
      if (!this.robot && !this.arm) {
        [this.shown, this.faults] = ["", {}];
        return;
      }
      const asked = this.typed;
      const arm = this.robot ? {} : { arm: this.arm.id, convention: this.convention, maker: this.maker };
      const answer = await fetch("/api/cells/form", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ ...arm, robot: this.robot, frame: this.frame, numbers: this.numbers }) });
      const found = await answer.json();
      if (asked !== this.typed) return;
      this.fault = answer.ok ? null : found;
      this.faults = found.faults ?? {};
      this.cautions = found.cautions ?? {};
      this.armFiles = found.arm_files ?? [];
      if (found.joints) this.armJoints = found.joints;
      if (found.text) this.shown = found.text;
      this.ready = answer.ok && !!found.text;
    },
    async keep() {
      this.busy = true;
      try {
        const made = await window.bench.ask("POST", "/api/cells/text", { text: this.shown, name: this.name.trim() || this.robot || this.arm.name.replace(/\.\w+$/, ""), uploads: this.armFiles.length ? [this.arm.id] : [] });
        location.href = `/cell?cell=${made.id}`;
      } catch (cause) {
        this.fault = cause;
        this.busy = false;
      }
    },
  },
};
