// Holes of a drilling session as they come, or of a test: bull's-eyes of the tilt, the run of what is left, alarms.
const KEPT = 400; // holes drawn; all count in the tiles
const SIDE = 400;
const REGION = Math.sqrt(-2 * Math.log(0.05)); // deviations within which two dimensions lie with 95 %
const size = (v) => Math.hypot(v[0], v[1]);
const round = (v) => { // the next 1, 2 or 5
  const power = 10 ** Math.floor(Math.log10(v));
  return [1, 2, 5, 10].find((k) => v <= k * power * 1.0001) * power;
};

export default {
  template: `
  <div data-testid="drill-monitor" :data-holes="holes.length">
    <div class="card fault" v-if="fault" role="alert" v-html="said(fault)"></div>
    <p class="card note" v-if="src && !holes.length && !fault">{{ text.waiting }}</p>
    <template v-if="holes.length">
      <div class="tiles" v-if="src">
        <div class="tile"><div class="label">{{ text.holes }}</div><div class="value">{{ moved.length }}</div><div class="was" v-if="refused">{{ refused }} {{ text.refused }}</div></div>
        <div class="tile" :class="measured.length ? (p95 <= tolerance ? 'good' : 'bad') : ''"><div class="label">{{ text.p95 }}</div><div class="value">{{ deg(p95) }}<span class="unit">deg</span></div></div>
        <div class="tile"><div class="label">{{ text.mean }}</div><div class="value">{{ deg(mean) }}<span class="unit">deg</span></div></div>
        <div class="tile" :class="measured.length ? (beyond ? 'bad' : 'good') : ''"><div class="label">{{ text.within }}</div><div class="value">{{ measured.length - beyond }}<span class="unit">/ {{ measured.length }}</span></div></div>
        <div class="tile" :class="alarms.length ? 'bad' : ''"><div class="label">{{ text.alarms }}</div><div class="value" data-testid="drill-alarms">{{ alarms.length }}</div></div>
        <div class="tile"><div class="label">{{ text.model }}</div><div class="value">v{{ version }}</div><div class="label">{{ frozen === null ? '' : frozen ? text.frozen.replace('{n}', frozen) : text.learning }}</div></div>
      </div>
      <div class="drill-eyes">
        <div class="card" v-for="eye in eyes" :key="eye.title">
          <h2>{{ eye.title }}</h2>
          <svg class="eye" :viewBox="'0 0 ${SIDE} ${SIDE}'" role="img" :aria-label="eye.title">
            <g v-for="r in eye.rings" :key="r.value"><circle :cx="${SIDE / 2}" :cy="${SIDE / 2}" :r="r.r" :class="r.kind"/>
              <text :x="${SIDE / 2 + 5}" :y="${SIDE / 2} - r.r - 4">{{ r.label }}</text></g>
            <line x1="8" :x2="${SIDE - 8}" y1="${SIDE / 2}" y2="${SIDE / 2}"/><line y1="8" y2="${SIDE - 8}" x1="${SIDE / 2}" x2="${SIDE / 2}"/>
            <text x="${SIDE - 8}" y="${SIDE / 2 - 6}" text-anchor="end">a</text><text x="${SIDE / 2 - 7}" y="18" text-anchor="end">b</text>
            <ellipse v-if="eye.band" :cx="eye.band.x" :cy="eye.band.y" :rx="eye.band.rx" :ry="eye.band.ry" class="band"/>
            <circle v-for="p in eye.points" :key="p.key" :cx="p.x" :cy="p.y" :r="p.last ? 6 : 3.5" :class="p.kind"><title>{{ p.title }}</title></circle>
          </svg>
          <p class="note">{{ eye.note }}</p>
        </div>
      </div>
      <div class="card" v-if="src && measured.length">
        <h2>{{ text.run }}</h2>
        <svg class="chart" viewBox="0 0 1000 210" role="img" :aria-label="text.run">
          <rect v-for="f in run.frozen" :key="'f' + f.x" :x="f.x" y="10" :width="f.w" height="170" class="still"/>
          <g v-for="t in run.ticks" :key="t.y"><line x1="54" x2="990" :y1="t.y" :y2="t.y" class="grid"/><text x="48" :y="t.y + 4" text-anchor="end">{{ t.label }}</text></g>
          <line x1="54" x2="990" :y1="run.tolerance" :y2="run.tolerance" class="tolerance"/>
          <line v-for="a in run.alarms" :key="'a' + a.x" :x1="a.x" :x2="a.x" y1="10" y2="180" class="alarm"/>
          <circle v-for="p in run.points" :key="p.key" :cx="p.x" :cy="p.y" r="4" :class="p.kind"><title>{{ p.title }}</title></circle>
          <text x="54" y="204">{{ run.first }}</text><text x="990" y="204" text-anchor="end">{{ run.last }}</text>
        </svg>
        <p class="note">{{ text.run_note }}</p>
      </div>
      <div class="card" v-if="alarms.length" data-testid="drill-alarm-list">
        <h2>{{ text.alarms }}</h2>
        <ul class="remarks"><li v-for="a in alarms.slice(-20).reverse()" :key="a.key"><b>{{ a.name }}</b> <span class="note">{{ time(a.at) }}</span> {{ a.said }}</li></ul>
      </div>
      <div class="card" v-if="src">
        <h2>{{ text.latest }}</h2>
        <div class="scroll"><table class="grid" data-testid="drill-holes"><thead><tr><th class="w">{{ text.hole }}</th><th class="w"></th><th class="w">{{ text.when }}</th>
          <th>{{ text.seen }} a, b deg</th><th>± 2σ deg</th><th>{{ text.left }} a, b deg</th><th>{{ text.left }} deg</th><th>{{ text.version }}</th></tr></thead>
          <tbody><tr v-for="h in holes.slice(-100).reverse()" :key="h.key">
            <td class="w"><b>{{ h.name }}</b></td><td class="w"><span class="tag" :class="state(h)[0]">{{ state(h)[1] }}</span> <span class="note" v-if="h.refused">{{ h.refused }}</span></td>
            <td class="w">{{ time(h.at) }}</td>
            <td>{{ h.seen ? deg(h.seen[0], 3) + ', ' + deg(h.seen[1], 3) : '–' }}</td><td>{{ h.sd ? deg(2 * Math.max(...h.sd)) : '–' }}</td>
            <td>{{ h.left ? deg(h.left[0]) + ', ' + deg(h.left[1]) : '–' }}</td><td>{{ h.left ? deg(size(h.left)) : '–' }}</td><td>{{ h.version }}</td></tr></tbody></table></div>
      </div>
    </template>
  </div>`,
  props: { src: String, fixed: Array, tolerance: Number, language: String, text: Object },
  data: () => ({ holes: [], alarms: [], next: 0, frozen: null, version: 0, fault: null, simulated: false }),
  computed: {
    moved() { return this.holes.filter((h) => h.seen); },
    refused() { return this.holes.filter((h) => h.refused).length; },
    measured() { return this.holes.filter((h) => h.left); },
    sizes() { return this.measured.map((h) => size(h.left)).sort((a, b) => a - b); },
    mean() { return this.sizes.reduce((a, b) => a + b, 0) / this.sizes.length; },
    p95() { return quantile(this.sizes, 0.95); },
    beyond() { return this.sizes.filter((v) => v > this.tolerance).length; },
    eyes() {
      const holes = this.holes.slice(-KEPT);
      const last = holes[holes.length - 1];
      const seen = this.eye(holes.filter((h) => h.seen), (h) => h.seen, "before", this.text.before, this.text.before_note);
      const left = this.eye(holes.filter((h) => h.left), (h) => h.left, "after", this.text.after, this.text.after_note);
      for (const [eye, h, at] of [[seen, last, last?.seen], [left, last, last?.seen && [0, 0]]]) {
        if (h?.sd && at) eye.band = { x: eye.at(at)[0], y: eye.at(at)[1], rx: REGION * h.sd[0] * eye.scale, ry: REGION * h.sd[1] * eye.scale };
      }
      return [seen, left];
    },
    run() {
      const shown = this.holes.slice(-KEPT).filter((h) => h.left);
      const most = Math.max(...shown.map((h) => size(h.left)));
      const top = most <= this.tolerance ? 1.2 * this.tolerance : round(most);
      const x = (k) => 62 + (k / Math.max(1, shown.length - 1)) * 920;
      const y = (v) => 180 - (v / top) * 170;
      const step = 920 / Math.max(1, shown.length - 1);
      const named = (h) => `${h.name}: ${this.deg(size(h.left))} deg`;
      return {
        points: shown.map((h, k) => ({ key: h.key, x: x(k), y: y(size(h.left)), kind: size(h.left) > this.tolerance ? "bad" : "after", title: named(h) })),
        alarms: shown.flatMap((h, k) => (h.alarm ? [{ x: x(k) }] : [])),
        frozen: shown.flatMap((h, k) => (h.frozen ? [{ x: x(k) - step / 2, w: step }] : [])),
        ticks: [0, 0.5, 1].map((s) => ({ y: y(s * top), label: String(Number((s * top).toPrecision(3))) })),
        tolerance: y(this.tolerance), first: shown[0]?.name, last: shown[shown.length - 1]?.name,
      };
    },
  },
  mounted() {
    if (this.fixed) this.holes = this.fixed.map((h, k) => ({ key: k, name: String(k + 1), seen: h.before, left: h.left }));
    else this.follow();
  },
  beforeUnmount() { clearTimeout(this.timer); this.gone = true; },
  methods: {
    size,
    said: (fault) => window.bench.fault(fault),
    async follow() {
      let wait = 1000;
      try {
        const answer = await fetch(`${this.src}?after=${this.next}`);
        const found = await answer.json();
        if (answer.ok) {
          if (found.anew) Object.assign(this, { holes: [], alarms: [], frozen: null });
          this.take(found.entries);
          if (found.next < found.size && found.entries.length) wait = 0;
          this.next = found.next;
          this.fault = null;
        } else [this.fault, wait] = [found, 5000];
      } catch { /* the server is away for a moment */ }
      if (!this.gone) this.timer = setTimeout(() => this.follow(), wait);
    },
    take(entries) {
      for (const e of entries) {
        this.version = e.version;
        this.simulated ||= e.simulated === true;
        if (e.kind === "answer") {
          const move = e.status === "move";
          this.holes.push({
            key: this.holes.length, name: e.hole, at: e.written_utc, version: e.version,
            seen: move ? [e.a_deg, e.b_deg] : null, sd: move ? [e.a_sigma_deg, e.b_sigma_deg] : null,
            refused: move ? "" : e.said, left: null,
          });
        } else {
          const hole = this.holes.findLast((h) => h.name === e.hole && h.seen && !h.left);
          if (hole) Object.assign(hole, { left: [e.left_a_deg, e.left_b_deg], alarm: e.status === "alarm", frozen: e.frozen, version: e.version });
          if (e.status === "alarm") this.alarms.push({ key: this.alarms.length, name: e.hole, at: e.written_utc, said: this.shifted(e) });
          this.frozen = e.frozen ?? null;
        }
      }
      if (this.simulated) document.querySelectorAll("[data-simulated-later]").forEach((n) => (n.hidden = false));
    },
    // Points about a middle, rings at the tolerance and at a round number outside.
    eye(holes, of, kind, title, note) {
      const last = holes[holes.length - 1];
      const bands = holes.length && last.sd ? REGION * Math.max(...last.sd) : 0;
      const most = Math.max(bands, ...holes.map((h) => size(of(h))));
      const near = most <= this.tolerance;
      const reach = near ? 1.15 * this.tolerance : round(most);
      const scale = (SIDE / 2 - 26) / reach;
      const at = (v) => [SIDE / 2 + v[0] * scale, SIDE / 2 - v[1] * scale];
      const rings = (near ? [this.tolerance / 2] : [reach / 2, reach]).map((v) => ({ value: v, r: v * scale, kind: "ring", label: `${Number(v.toPrecision(2))}°` }));
      if (this.tolerance * scale > 5) rings.push({ value: this.tolerance, r: this.tolerance * scale, kind: "tolerance", label: !near && Math.abs(this.tolerance / reach - 0.5) < 0.12 ? "" : `${this.tolerance}°` });
      const points = holes.map((h) => {
        const [x, y] = at(of(h));
        const outside = kind === "after" && size(of(h)) > this.tolerance;
        return { key: h.key, x, y, kind: `${outside ? "bad" : kind}${h === last && this.src ? " last" : ""}`, last: h === last && !!this.src, title: `${h.name}: ${this.deg(of(h)[0])}, ${this.deg(of(h)[1])} deg` };
      });
      return { title, note, rings, points, at, scale, band: null };
    },
    shifted(e) {
      const [a, b] = (e.shift_deg ?? []).map((v) => (v >= 0 ? "+" : "") + this.deg(v, 3));
      return this.text.shifted.replace("{a}", a).replace("{b}", b) + (this.frozen ? ` ${this.text.thawed.replace("{n}", this.frozen)}` : "");
    },
    state(h) {
      if (h.refused) return ["caution", this.text.state_refused];
      if (h.alarm) return ["bad", this.text.state_alarm];
      if (!h.left) return ["busy", this.text.state_moved];
      return size(h.left) > this.tolerance ? ["bad", this.text.state_beyond] : ["good", this.text.state_within];
    },
    deg(v, digits = 4) { return Number.isFinite(v) ? v.toFixed(digits) : "–"; },
    time(at) { return at ? new Date(at).toLocaleTimeString(this.language === "zh" ? "zh-CN" : "en-GB") : ""; },
  },
};

function quantile(sorted, share) { // linear between the two beside it, as numpy's
  if (!sorted.length) return NaN;
  const place = share * (sorted.length - 1);
  const low = Math.floor(place);
  return sorted[low] + (place - low) * ((sorted[low + 1] ?? sorted[low]) - sorted[low]);
}
