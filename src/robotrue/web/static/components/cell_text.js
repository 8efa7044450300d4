// The text of a cell.toml, changed into the next version of its cell; the line of a fault is marked.
export default {
  template: `
  <form class="card" @submit.prevent="keep" data-testid="cell-text">
    <div class="toml-edit"><pre class="toml-lines" aria-hidden="true" ref="lines"><span v-for="n in count" :key="n" :class="{wrong: fault?.line === n}">{{ n }}</span></pre>
      <textarea ref="area" v-model="content" spellcheck="false" autocapitalize="off" wrap="off" :aria-label="text.text_title" :readonly="old" data-testid="cell-text-area" @scroll="$refs.lines.scrollTop = $event.target.scrollTop"></textarea></div>
    <div class="card fault" v-if="fault" role="alert" data-testid="cell-text-fault" style="margin:12px 0 0" v-html="said(fault)"></div>
    <div style="display:flex;gap:10px;margin-top:12px"><button class="act" :disabled="busy || (!old && content === start)" data-testid="cell-text-keep">{{ old ? text.keep_old : text.keep_text }}</button></div>
  </form>`,
  props: { id: String, version: Number, latest: Number, text: Object },
  data: () => ({ content: "", start: "", fault: null, busy: false }),
  computed: {
    old() { return this.version !== this.latest; },
    count() { return this.content.split("\n").length; },
  },
  async mounted() {
    const answer = await fetch(`/api/cells/${this.id}/text?version=${this.version}`);
    this.content = this.start = await answer.text();
  },
  methods: {
    said: (fault) => window.bench.fault(fault),
    async keep() {
      this.busy = true;
      try {
        await window.bench.ask("POST", `/api/cells/${this.id}/text`, { text: this.content, version: this.latest });
        location.href = `/cell?cell=${this.id}&edit=1`;
      } catch (cause) {
        this.fault = cause;
        this.busy = false;
      }
    },
  },
};
