// A job that is under way: how far it is, a way to stop it, and what it failed with. The one asked for last in this tab leads
// to what came of it; of the others the way there is offered, so that nobody is led away from what he looks at.
export default {
  template: `
  <div class="card" v-if="job" data-testid="job" :data-state="job.state">
    <div class="head" style="margin-bottom:10px">
      <h2>{{ text.title }}</h2><span class="tag" :class="tone">{{ text['state_' + job.state] }}</span>
      <span class="note">{{ step }}</span>
      <span class="note" v-if="!job.over && job.progress" data-testid="job-progress">{{ Math.round(100 * job.progress) }} %{{ left }}</span>
      <div class="acts"><a class="act" v-if="result" :href="result" data-testid="job-open">{{ text.open }}</a><button class="act quiet" v-if="!job.over" data-testid="cancel" :disabled="job.cancel" @click="cancel">{{ text.cancel }}</button></div>
    </div>
    <div class="progress" v-if="!job.over"><i :style="{width: Math.max(2, 100 * job.progress) + '%'}"></i></div>
    <div v-if="job.error" role="alert" data-testid="job-fault" v-html="said(job.error)"></div>
    <ul class="remarks note" v-if="job.over && job.remarks.length"><li v-for="r in job.remarks.slice(0, 8)">{{ r }}</li></ul>
  </div>`,
  props: { id: String, text: Object, steps: Object, go: String, field: String },
  data: () => ({ job: null, elapsed: 0 }),
  computed: {
    // "elastic, blocks 2/5": each part in the reader's words, the number after it as it is.
    step() {
      const word = (part) => this.steps[part.replaceAll(" ", "_")] ?? part.replace(/^(blocks|regions|sets|random) /, (all, kind) => `${this.steps?.[kind] ?? kind} `);
      return this.job.text.split(", ").map(word).join(", ");
    },
    // Steps differ in length: stated only when a tenth is done, and roughly.
    left() {
      const { progress } = this.job, seconds = (this.elapsed * (1 - progress)) / progress;
      if (progress < 0.1 || !(this.elapsed > 3)) return "";
      const time = seconds < 90 ? `${5 * Math.ceil(seconds / 5)} s` : `${Math.ceil(seconds / 60)} min`;
      return ", " + this.text.left.replace("{time}", time);
    },
    result() {
      if (this.job.state === "done" && this.go.includes("{job}")) return this.go.replace("{job}", this.id);
      const made = this.job.state === "done" && this.job.result?.[this.field];
      return made ? this.go.replace("{id}", made.id) : "";
    },
    tone() { return { done: "good", failed: "bad", cancelled: "caution" }[this.job.state] ?? "busy"; },
  },
  mounted() { this.look(); },
  beforeUnmount() { clearTimeout(this.timer); },
  methods: {
    said: (fault) => window.bench.fault(fault),
    async look() {
      try {
        const answer = await fetch(`/api/jobs/${this.id}`);
        const found = answer.ok ? await answer.json() : this.job;
        if (!this.job && found?.state === "done" && window.bench.own() !== this.id) return; // of somebody else, and over
        this.job = found;
        this.elapsed = (Date.parse(answer.headers.get("date")) - Date.parse(found?.started)) / 1e3;
      } catch { /* the server is away for a moment */ }
      if (this.job && this.result && window.bench.own() === this.id) {
        window.bench.own("");
        location.href = this.result;
      } else if (!this.job?.over) this.timer = setTimeout(this.look, 600);
    },
    async cancel() {
      await fetch(`/api/jobs/${this.id}/cancel`, { method: "POST" }).catch(() => {});
      clearTimeout(this.timer);
      this.look();
    },
  },
};
