// A live source: the view that the sensing service's own page shows, too, then limits and alarms.
export default {
  template: `
  <div>
    <div class="live" data-testid="live-view" v-html="shown"></div>
    <div class="columns live-below">
      <div class="card">
        <div class="head"><h2>{{ text.alarms }}</h2><span class="tag bad" v-if="open" data-testid="alarm-now">{{ text.now }}</span>
          <div class="acts"><a class="act quiet" :class="{off: !alarms.length}" download :href="base + '/alarms.csv'" data-testid="alarms-csv">{{ text.download }}</a></div></div>
        <p class="note" v-if="!alarms.length">{{ text.no_alarms }}</p>
        <div class="scroll" v-else><table class="grid" data-testid="alarms"><thead><tr>
          <th class="w">{{ text.when }}</th><th class="w">{{ text.axis }}</th><th>{{ text.value }} µm</th><th>{{ text.band }} µm</th>
          <th>{{ text.limit }} µm</th><th>{{ text.duration }} s</th><th class="w"></th></tr></thead>
          <tbody><tr v-for="a in alarms.slice(0, 200)" :key="a.key">
            <td class="w">{{ time(a.begun) }}</td><td class="w"><b>e{{ a.axis }}</b></td><td>{{ number(a.value_um, 1) }}</td><td>{{ number(a.band_um, 1) }}</td>
            <td>{{ number(a.limit_um, 0) }}</td><td>{{ a.over ? number(a.duration_s, 2) : "…" }}</td>
            <td class="w"><span class="tag bad" v-if="live.has(a.key)">{{ text.now }}</span><span class="tag" v-else-if="!a.over">{{ text.unfinished }}</span>
              <span class="tag caution" v-if="unsure(a)" >{{ text.unsure }}</span></td></tr></tbody></table></div>
      </div>
      <form class="card" @submit.prevent="save" data-testid="limits-form">
        <h2>{{ text.limits }}</h2>
        <div class="fields">
          <label class="field" v-for="(axis, k) in ['x', 'y', 'z']" :key="axis">{{ text.limit_of }} e{{ axis }}, µm
            <input type="number" min="0" max="1000000" step="any" v-model.number="limits[k]" :data-testid="'limit-' + axis"></label>
        </div>
        <div class="head below"><button class="act" data-testid="limits-save">{{ text.save }}</button><span class="note" role="status" v-html="said"></span></div>
        <p class="note">{{ text.limits_rule }}</p>
      </form>
    </div>
  </div>`,
  props: { id: String, files: String, markup: String, language: String, text: Object, held: Array },
  data() {
    return { shown: this.markup, alarms: [], live: new Set(), limits: this.held.map((v) => v || ""), said: "" };
  },
  computed: {
    base() { return `/api/live/sources/${this.id}`; },
    open() { return this.live.size > 0; },
  },
  async mounted() {
    const view = await import(`${this.files}/live.js`);
    this.view = view;
    view.limits(this.held);
    view.start({ path: `${this.base}/frames`, language: this.language, onFrame: this.take });
    window.addEventListener("bench-theme", view.recolour);
  },
  beforeUnmount() { if (this.view) window.removeEventListener("bench-theme", this.view.recolour); },
  methods: {
    async list() {
      const answer = await fetch(`${this.base}/alarms`);
      if (!answer.ok) return;
      const ended = new Map(this.alarms.filter((a) => a.over).map((a) => [a.key, a])); // told before they were written
      const kept = (await answer.json()).items.map((a) => ended.get(a.key) ?? a);
      const known = new Set(kept.map((a) => a.key));
      this.alarms = [...this.alarms.filter((a) => !known.has(a.key)), ...kept];
    },
    take(frame) {
      if (frame.type === "alarm") {
        this.alarms = [frame, ...this.alarms.filter((a) => a.key !== frame.key)].sort((a, b) => (a.begun < b.begun ? 1 : -1));
        frame.over ? this.live.delete(frame.key) : this.live.add(frame.key);
        this.live = new Set(this.live);
      } else if (frame.type === "limits") {
        this.list(); // what ended before this page was listening
        setTimeout(this.list, 3000); // and what was only being written then
        this.view.limits(frame.um);
        if (document.activeElement?.closest("form")?.dataset.testid !== "limits-form") this.limits = frame.um.map((v) => v || "");
      }
    },
    async save() {
      const [x_um, y_um, z_um] = this.limits.map((v) => Math.abs(Number(v)) || 0);
      try {
        await window.bench.ask("PUT", `${this.base}/limits`, { x_um, y_um, z_um });
        this.said = window.bench.plain(this.text.saved);
        this.view.limits([x_um, y_um, z_um]);
      } catch (cause) { this.said = window.bench.fault(cause); }
    },
    unsure(a) { return Math.abs(a.value_um) - a.band_um < a.limit_um; },
    number(v, digits) { return typeof v === "number" ? v.toFixed(digits) : "—"; },
    time(at) { return new Date(at).toLocaleString(this.language === "zh" ? "zh-CN" : "en-GB", { dateStyle: "short", timeStyle: "medium" }); },
  },
};
