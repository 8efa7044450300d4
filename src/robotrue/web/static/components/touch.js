// A session at the part: the next point to touch, its reading, and how well the part is known.
// Every reading is in the store before the page says so; others who look see it a moment later.
export default {
  template: `
  <div class="touch" data-testid="touch" :data-version="s?.version" :data-state="state">
    <div class="card fault" v-if="fault" role="alert" data-testid="touch-fault" v-html="said(fault)"></div>
    <p class="note" v-if="!s && !fault">{{ text.working }}</p>
    <div class="columns" v-if="s">
      <div>
        <div class="card touch-held" v-if="s.held" data-testid="held" role="alert">
          <div class="touch-step">{{ text.held_title }}</div>
          <h2 class="touch-name">{{ name(s.held.feature) }}</h2>
          <p class="touch-off" data-testid="held-off">{{ say('held_off', {off: length(s.held.off_mm), sigmas: sigmas(s.held.sigmas)}) }}</p>
          <ul class="remarks" data-testid="suspicions"><li v-for="w in s.held.suspicions">{{ reason(w) }}</li>
            <li v-if="!s.held.suspicions.length">{{ text.why_none }}</li></ul>
          <p class="mono touch-text">{{ s.held.text }}</p>
          <div class="touch-acts">
            <button class="act" :disabled="busy" data-testid="retake" @click="decide('retake')">{{ text.retake }}</button>
            <button class="act quiet" :disabled="busy" data-testid="keep" @click="decide('keep')">{{ text.keep }}</button>
            <button class="act quiet" :disabled="busy" data-testid="skip" @click="decide('skip')">{{ text.skip }}</button>
          </div>
        </div>
        <div class="card" v-else-if="s.next" data-testid="next">
          <div class="touch-step">{{ chosen < 0 ? say('step', {number: s.kept + 1}) : text.step_chosen }}
            <button class="touch-link" v-if="chosen >= 0" @click="choose(-1)">{{ text.back }}</button></div>
          <h2 class="touch-name" data-testid="next-name">{{ name(s.next.feature) }}</h2>
          <p class="touch-place">{{ text.place }} <b>{{ triple(s.features[s.next.feature].point_mm, 1) }}</b> mm<span v-if="s.parts.length > 1"> · {{ s.parts[s.features[s.next.feature].part] }}</span><span v-if="s.features[s.next.feature].surface"> · {{ text.surface }}</span></p>
          <template v-if="s.next.joints_deg">
            <div class="touch-axes" :data-reached="s.next.reached"><div v-for="(q, k) in s.next.joints_deg" :key="k"><span>{{ axisName(k) }}</span><b>{{ q.toFixed(2).replace("-", "−") }}°</b></div></div>
            <dl class="facts touch-facts">
              <dt>{{ text.approach }}</dt><dd>{{ approach }}</dd>
              <dt>{{ text.pose }}</dt><dd>{{ triple(s.next.pose.xyz_mm, 1) }} mm; {{ letters }} {{ turns }}</dd>
              <dt>{{ text.expected }}</dt><dd data-testid="expected"><b>{{ triple(s.next.expected.xyz_mm, 2) }}</b> mm <b>± {{ length(s.next.expected.band_mm) }}</b> <span class="note">95 %</span></dd>
            </dl>
          </template>
          <template v-else>
            <p class="note" v-if="s.next.unreachable">{{ text.unreachable }}</p>
            <dl class="facts touch-facts" v-if="s.next.expected"><dt>{{ text.expected }}</dt><dd><b>{{ triple(s.next.expected.xyz_mm, 2) }}</b> mm <b>± {{ length(s.next.expected.band_mm) }}</b> <span class="note">95 %</span></dd></dl>
          </template>
          <form class="touch-enter" @submit.prevent="enter">
            <label class="field">{{ s.reads === 'joints' ? say('enter_joints', {axes: s.axes[0] + ' … ' + s.axes[s.axes.length - 1]}) : text.enter_position }}
              <input type="text" ref="line" v-model="line" :placeholder="placeholder" autocomplete="off" autocapitalize="off" spellcheck="false" data-testid="reading"></label>
            <div class="touch-acts">
              <button class="act" :disabled="busy || !line.trim()" data-testid="take">{{ text.take }}</button>
              <button type="button" class="act quiet" :disabled="busy" data-testid="skip" @click="skip">{{ text.skip }}</button>
              <button type="button" class="act quiet" :disabled="busy || !canUndo" data-testid="undo" @click="decide('undo')">{{ text.undo }}</button>
            </div>
          </form>
          <p class="note touch-last" v-if="last" data-testid="last" aria-live="polite">{{ last }}</p>
        </div>
        <div class="card" v-else data-testid="all-touched">
          <h2>{{ text.all }}</h2><p class="note">{{ text.all_text }}</p>
          <div class="touch-acts"><button class="act quiet" :disabled="busy || !canUndo" data-testid="undo" @click="decide('undo')">{{ text.undo }}</button></div>
          <p class="note touch-last" v-if="last" data-testid="last">{{ last }}</p>
        </div>
        <div class="card touch-points">
          <div class="head"><h2>{{ text.points }}</h2><span class="note">{{ say('counted', {kept: s.kept, all: s.features.length}) }}</span>
            <div class="acts"><label class="act quiet">{{ text.file }}<input type="file" hidden accept=".csv,.tsv,.txt,.xlsx" data-testid="readings-file" @change="takeFile"></label>
            <a class="act quiet" v-if="s.kept" :href="'/api/touching/' + id + '/readings.csv'" download data-testid="export">{{ text.export }}</a></div></div>
          <div class="scroll"><table class="grid" data-testid="points"><thead><tr><th class="w">{{ text.point }}</th><th>{{ text.in_part }} mm</th><th class="w">{{ text.state }}</th><th>{{ text.residual }} {{ unitName }}</th><th>{{ text.known }} {{ unitName }}</th></tr></thead>
            <tbody><tr v-for="(f, k) in s.features" :key="k" :class="{chosen: target === k}" tabindex="0" :data-feature="k" @click="choose(k)" @keydown.enter="choose(k)">
              <td class="w"><b>{{ name(k) }}</b></td><td>{{ triple(f.point_mm, 1) }}</td>
              <td class="w"><span class="tag" :class="tone(f)">{{ word(f) }}</span></td>
              <td>{{ f.residual_mm === null ? '' : number(f.residual_mm) }}</td><td>{{ f.radius_mm === null || f.radius_mm === undefined ? '–' : number(f.radius_mm) }}</td></tr></tbody></table></div>
        </div>
      </div>
      <div>
        <div class="card" data-testid="standing">
          <div class="label note">{{ text.known_to }}</div>
          <div class="touch-big" data-testid="radius">{{ number(best.radius) }}<span class="unit">{{ unitName }}</span></div>
          <div class="note">{{ say('known_at', {name: best.name}) }}</div>
          <div class="note" v-if="best.promised" data-testid="promised">{{ say('promised', {radius: length(s.known.radius_mm)}) }}</div>
          <svg class="chart touch-curve" v-if="drawn.length > 1" viewBox="0 0 320 90" role="img" :aria-label="text.curve">
            <line v-if="tolY !== null" x1="4" x2="316" :y1="tolY" :y2="tolY" class="tol"></line>
            <polyline :points="drawn.map((p) => p.join(',')).join(' ')"></polyline>
            <circle v-for="p in drawn" :cx="p[0]" :cy="p[1]" r="3"></circle>
          </svg>
          <p class="note" v-if="drawn.length > 1">{{ text.curve }}<span v-if="tolY !== null"> · <span class="touch-tol">- - -</span> {{ text.tolerance }} {{ length(s.settings.tolerance_mm) }}</span></p>
          <p class="note" v-if="gain" data-testid="gain">{{ gain }}</p>
        </div>
        <div class="card" data-testid="map"><h2>{{ text.map }}</h2>
          <svg class="chart touch-map" :viewBox="'0 0 320 ' + map.height" role="img" :aria-label="text.map">
            <text :x="318" :y="map.height - 4" text-anchor="end">{{ map.axes[0] }} →</text><text x="2" y="12">↑ {{ map.axes[1] }}</text>
            <g v-for="p in map.dots" :key="p.k" @click="choose(p.k)" class="dot" :class="[p.state, {next: p.k === target, worst: p.k === s.known.feature}]">
              <circle :cx="p.x" :cy="p.y" :r="p.k === target ? 9 : 6"></circle><title>{{ name(p.k) }}</title></g>
            <text v-if="map.label" :x="map.label.x" :y="map.label.y" :text-anchor="map.label.anchor" class="strong">{{ map.label.text }}</text>
          </svg></div>
        <div class="card verdict-card" :class="s.fit ? (s.fit.verdict === 'GO' ? 'good' : 'bad') : 'plain'" data-testid="estimate">
          <template v-if="s.fit">
            <div class="touch-verdict"><b>{{ s.fit.verdict }}</b><span class="note">{{ text['route_' + s.fit.route] }}</span></div>
            <div v-for="f in s.fit.frames" :key="f.name">
              <h3 v-if="s.fit.frames.length > 1">{{ f.name }}</h3>
              <dl class="facts"><dt>X, Y, Z</dt><dd>{{ triple(f.xyz_mm, 3) }} mm</dd><dt>A, B, C</dt><dd>{{ triple(f.abc_deg, 4) }}°</dd>
                <dt>{{ text.sd }}</dt><dd>{{ triple(f.sd_mm, 3) }} mm; {{ triple(f.sd_deg, 4) }}°</dd>
                <dt>{{ text.rms }}</dt><dd>{{ length(f.rms_mm) }}</dd>
                <dt>{{ f.with_arm ? text.machined : text.frame_there }}</dt><dd>{{ say('at', {length: length(f.region_mm), name: f.region_at}) }}</dd></dl>
              <ul class="remarks bad-list"><li v-for="r in f.reasons">{{ r }}</li></ul>
              <details v-if="f.warnings.length || s.fit.warnings.length"><summary class="note">{{ say('notes', {count: f.warnings.length + s.fit.warnings.length}) }}</summary>
                <ul class="remarks note"><li v-for="d in f.warnings.concat(s.fit.warnings)">{{ d }}</li></ul></details>
            </div>
            <form class="touch-finish" @submit.prevent="finish" v-if="!s.result">
              <label class="field">{{ text.finish_name }}<input type="text" v-model="finishName" maxlength="200" data-testid="finish-name"></label>
              <button class="act" :disabled="busy || s.held || !finishName.trim()" data-testid="finish">{{ s.fit.verdict === 'GO' ? text.finish : text.finish_nogo }}</button>
            </form>
            <a v-else class="act" :href="'/registration?registration=' + s.result" data-testid="result">{{ text.result }}</a>
          </template>
          <template v-else><h2>{{ text.no_frame }}</h2><p class="note">{{ s.waiting ? s.waiting.message : text.no_frame_text }}</p><p class="note" v-if="s.waiting?.hint">{{ s.waiting.hint }}</p></template>
        </div>
      </div>
    </div>
  </div>`,
  props: { id: String, text: Object, unit: String, angles: String, letters: String },
  data: () => ({ s: null, fault: null, busy: false, line: "", chosen: -1, finishName: "", away: false }),
  computed: {
    state() { return this.busy ? "busy" : this.away ? "away" : this.s ? "ready" : "loading"; },
    unitName() { return this.unit === "um" ? "µm" : "mm"; },
    target() { return this.s.held ? this.s.held.feature : this.s.next ? this.s.next.feature : -1; },
    best() {
      // What registering says where it can say it; before, what is believed from the first touch on.
      const frames = this.s.fit?.frames ?? [], worst = [...frames].sort((a, b) => b.region_mm - a.region_mm)[0];
      if (!worst) return { radius: this.s.known.radius_mm, name: this.name(this.s.known.feature), promised: false };
      const alone = this.s.fit.route === "frame" && this.s.reads === "joints";
      return { radius: worst.region_mm, name: worst.region_at, promised: alone && this.s.known.radius_mm < 0.8 * worst.region_mm };
    },
    canUndo() { return this.s.readings.some((r) => ["kept", "held", "skipped"].includes(r.state)); },
    placeholder() { return this.s.reads === "joints" ? this.s.axes.map((a) => `${a} …`).join(", ") : "X …, Y …, Z …"; },
    turns() {
      const digits = this.angles === "abb" || this.angles === "ur" ? 4 : 2;
      return this.triple(this.s.next.pose.orientation[this.angles], digits);
    },
    approach() {
      const a = this.s.next.approach;
      return this.say(a.off_deg < 1 ? "approach_straight" : "approach_leaned", { axis: a.axis.replace("-", "−"), off: a.off_deg.toFixed(0) });
    },
    last() {
      const r = this.s.readings[this.s.readings.length - 1];
      if (!r) return "";
      const facts = { name: this.name(r.feature), off: r.off_mm === null ? "" : this.length(r.off_mm), sigmas: r.sigmas === null ? "" : this.sigmas(r.sigmas) };
      return this.text["last_" + r.state] ? this.say("last_" + r.state, facts) : "";
    },
    gain() {
      const g = this.s.next?.gain;
      return g && !this.s.held ? this.say("gain", { now: this.length(g.now_mm), then: this.length(g.then_mm) }) : "";
    },
    scale() {
      const values = this.s.curve_mm.filter((v) => v > 0), tol = this.s.settings.tolerance_mm;
      const all = tol ? [...values, tol] : values;
      const low = Math.log(Math.min(...all)) - 0.1, high = Math.log(Math.max(...all)) + 0.1;
      return (v) => 82 - (74 * (Math.log(v) - low)) / Math.max(high - low, 1e-9);
    },
    drawn() {
      const values = this.s.curve_mm.filter((v) => v > 0);
      return values.map((v, k) => [6 + (308 * k) / Math.max(values.length - 1, 1), this.scale(v)]);
    },
    tolY() { return this.s.settings.tolerance_mm && this.drawn.length > 1 ? this.scale(this.s.settings.tolerance_mm) : null; },
    map() {
      const part = this.target >= 0 ? this.s.features[this.target].part : 0;
      const mine = this.s.features.map((f, k) => ({ f, k })).filter((e) => e.f.part === part);
      const span = [0, 1, 2].map((a) => Math.max(...mine.map((e) => e.f.point_mm[a])) - Math.min(...mine.map((e) => e.f.point_mm[a])));
      const [a, b] = [0, 1, 2].sort((p, q) => span[q] - span[p]).slice(0, 2).sort();
      const c = 3 - a - b, oblique = 0.35; // the third axis goes back and up, so that faces do not hide each other
      const flat = mine.map((e) => ({ ...e, u: e.f.point_mm[a] + oblique * e.f.point_mm[c], v: e.f.point_mm[b] + oblique * e.f.point_mm[c] }));
      const low = [Math.min(...flat.map((e) => e.u)), Math.min(...flat.map((e) => e.v))];
      const wide = Math.max(Math.max(...flat.map((e) => e.u)) - low[0], 1), tall = Math.max(Math.max(...flat.map((e) => e.v)) - low[1], 1);
      const scale = Math.min(270 / wide, 210 / tall), height = Math.max(90, tall * scale + 64);
      const dots = flat.map((e) => ({ k: e.k, state: e.f.state, x: 25 + (270 - wide * scale) / 2 + (e.u - low[0]) * scale, y: height - 34 - (e.v - low[1]) * scale }));
      const at = dots.find((d) => d.k === this.target);
      const label = at && { text: this.name(at.k), x: at.x + (at.x > 200 ? -14 : 14), y: at.y - 12 > 14 ? at.y - 12 : at.y + 24, anchor: at.x > 200 ? "end" : "start" };
      return { dots, label, height, axes: ["xyz"[a], "xyz"[b]] };
    },
  },
  mounted() { this.look(); },
  beforeUnmount() { clearTimeout(this.timer); this.gone = true; },
  methods: {
    said: (fault) => window.bench.fault(fault),
    say(key, values) { return this.text[key].replace(/\{(\w+)\}/g, (_, name) => values[name]); },
    name(k) {
      const same = this.s.features.slice(0, k).filter((f) => f.name === this.s.features[k].name && f.part === this.s.features[k].part).length;
      return this.s.features[k].name + (same ? ` (${same + 1})` : "");
    },
    axisName(k) { return this.s.reads === "joints" ? this.s.axes[k] : `A${k + 1}`; },
    triple(values, digits) { return values.map((v) => (Math.abs(v) < 0.5 * 10 ** -digits ? 0 : v).toFixed(digits).replace("-", "−")).join(", "); },
    number(mm) { return this.unit === "um" ? (1e3 * mm).toFixed(0) : mm < 9.995 ? mm.toFixed(3) : mm.toFixed(1); },
    length(mm) { return `${this.number(mm)} ${this.unitName}`; },
    sigmas(v) { return v < 99.5 ? v.toFixed(1) : v.toFixed(0); },
    word(f) { return f.state === "kept" && !f.believed ? this.text.state_doubted : !f.reachable && f.state === "open" ? this.text.state_far : this.text["state_" + f.state]; },
    tone(f) { return f.state === "kept" ? (f.believed ? "good" : "bad") : f.state === "held" ? "caution" : "plain"; },
    reason(w) {
      const off = w.length_mm === undefined ? "" : `${w.length_mm > 0 ? "+" : "−"}${this.length(Math.abs(w.length_mm))}`;
      const name = w.kind === "sign" && this.s.reads === "joints" ? this.s.axes[Number(w.name) - 1] : w.name;
      return this.say("why_" + w.kind, { name, off });
    },
    async look() {
      clearTimeout(this.timer);
      try {
        if (!this.s) await this.fetchState();
        else if (!this.busy && document.visibilityState === "visible") {
          const answer = await fetch(`/api/touching/${this.id}/version`);
          if (answer.ok && !this.busy && (await answer.json()).version !== this.s.version) await this.fetchState();
        }
        this.away = false;
      } catch { this.away = true; }
      if (!this.gone) this.timer = setTimeout(this.look, 1500);
    },
    async fetchState() {
      const answer = await fetch(`/api/touching/${this.id}?feature=${this.chosen}`);
      const found = await answer.json();
      if (!answer.ok) { this.fault = found; return; }
      this.s = found;
      this.finishName ||= found.name;
    },
    async send(what, body, done) {
      this.busy = true;
      this.fault = null;
      try {
        const answer = await fetch(`/api/touching/${this.id}/${what}`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ version: this.s.version, ...body }) });
        const found = await answer.json();
        if (answer.ok) await done(found);
        else this.fault = found;
        if (answer.ok || answer.status === 409) await this.fetchState();
        return answer.ok;
      } catch {
        this.fault = { title: this.text.away, detail: this.text.away_text };
        return false;
      } finally { this.busy = false; }
    },
    async enter() {
      const feature = this.s.next.feature;
      const taken = await this.send("readings", { feature, text: this.line }, () => { this.line = ""; this.chosen = -1; });
      if (taken) this.$nextTick(() => this.$refs.line?.focus());
    },
    decide(decision) { return this.send("decisions", { decision }, () => { this.chosen = -1; }); },
    skip() { return this.send("decisions", { decision: "skip", feature: this.s.next.feature }, () => { this.chosen = -1; }); },
    async choose(k) {
      if (this.s.held || this.busy) return;
      this.chosen = k;
      await this.fetchState();
    },
    async takeFile(event) {
      const file = event.target.files[0];
      event.target.value = "";
      if (!file) return;
      try {
        const sent = await window.bench.send(`/api/files?name=${encodeURIComponent(file.name)}`, file);
        await this.send("files", { uploads: [sent.id] }, () => {});
      } catch (cause) { this.fault = cause; }
    },
    finish() { return this.send("registration", { name: this.finishName }, (made) => { location.href = `/registration?registration=${made.id}`; }); },
  },
};
