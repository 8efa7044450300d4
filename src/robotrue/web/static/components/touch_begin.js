// The form that begins a session at the part: which cell, which model, which points.
const MORE = { touch_sigma_mm: 0.1, tool_sigma_mm: "", probe_radius_mm: 0, rough_mm: 20, lean_deg: 15 };

export default {
  template: `
  <form class="card touch-begin" @submit.prevent="begin" data-testid="begin-form">
    <h2>{{ text.begin_title }}</h2>
    <label class="drop-zone" :class="{over}" @dragover.prevent="over = true" @dragleave="over = false" @drop.prevent="over = false; file = $event.dataTransfer.files[0]">
      <input type="file" accept=".csv,.tsv,.txt,.xlsx,.ods" data-testid="features-file" @change="file = $event.target.files[0]">
      <b>{{ file ? file.name : text.begin_drop }}</b><span>{{ text.begin_hint }}</span>
    </label>
    <div class="fields">
      <label class="field">{{ text.cell }}<select v-model="asked.cell" data-testid="begin-cell"><option v-for="c in cells" :key="c.id" :value="c.id">{{ c.name }}</option></select></label>
      <label class="field">{{ text.model }}<select v-model="asked.model" data-testid="begin-model"><option :value="null">{{ text.nominal }}</option><option v-for="m in models" :key="m.id" :value="m.id">{{ m.name }}</option></select></label>
      <label class="field">{{ text.reads }}<select v-model="asked.reads" data-testid="begin-reads"><option value="joints">{{ text.reads_joints }}</option><option value="position">{{ text.reads_position }}</option></select></label>
      <label class="field">{{ text.tolerance_mm }}<input type="number" min="0.001" max="100" step="any" v-model="tolerance" data-testid="begin-tolerance"></label>
      <label class="field wide">{{ text.frame }}<input type="text" v-model="asked.frame" placeholder="800, −100, 400, 0, 0, 0" data-testid="begin-frame"></label>
      <label class="field">{{ text.name }}<input type="text" maxlength="200" v-model="asked.name" data-testid="begin-name"></label>
    </div>
    <details><summary class="note">{{ text.more }}</summary>
      <div class="fields" style="margin-top:10px">
        <label class="field" v-for="(_, key) in more" :key="key">{{ text[key] }}<input type="number" min="0" step="any" v-model="more[key]" :data-testid="'begin-' + key"></label>
        <label class="field">{{ text.tip_axis }}<select v-model="asked.tip_axis"><option v-for="a in ['+z','-z','+x','-x','+y','-y']" :key="a">{{ a }}</option></select></label>
        <label class="field">{{ text.axes }}<select v-model="asked.axes"><option value="controller">{{ text.axes_controller }}</option><option value="model">{{ text.axes_model }}</option></select></label>
        <label class="field">{{ text.fit }}<select v-model="asked.fit"><option v-for="f in ['auto','frame','joint']" :key="f" :value="f">{{ text['fit_' + f] }}</option></select></label>
      </div></details>
    <div class="card fault" v-if="fault" role="alert" data-testid="begin-fault" style="margin:0" v-html="said(fault)"></div>
    <div class="touch-acts"><button class="act" :disabled="busy || !file" data-testid="begin">{{ busy ? text.working : text.begin }}</button></div>
  </form>`,
  props: { cells: Array, models: Array, text: Object },
  data() {
    return {
      file: null, over: false, busy: false, fault: null, tolerance: "", more: { ...MORE },
      asked: { cell: this.cells[0].id, model: this.models[0]?.id ?? null, reads: "joints", frame: "", name: "", tip_axis: "+z", axes: "controller", fit: "auto" },
    };
  },
  methods: {
    said: (fault) => window.bench.fault(fault),
    async begin() {
      this.busy = true;
      this.fault = null;
      try {
        const sent = await window.bench.send(`/api/files?name=${encodeURIComponent(this.file.name)}`, this.file);
        const lengths = Object.entries({ ...this.more, tolerance_mm: this.tolerance }).filter(([, v]) => v !== "" && v !== null);
        const body = { ...this.asked, frame: this.asked.frame.replaceAll("−", "-"), uploads: [sent.id], ...Object.fromEntries(lengths.map(([k, v]) => [k, Number(v)])) };
        const answer = await fetch("/api/touching", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) });
        const made = await answer.json();
        if (!answer.ok) throw made;
        location.href = `/registration?id=${made.id}`;
      } catch (cause) {
        this.fault = cause;
        this.busy = false;
      }
    },
  },
};
