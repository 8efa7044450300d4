// The text of a cell.toml, changed into the next version of its cell; the line of a fault is marked.
export default {
  template: `
  <form class="card" @submit.prevent="keep" data-testid="cell-text">
    <div class="toml-edit"><pre class="toml-lines" aria-hidden="true" ref="lines"><span v-for="n in count" :key="n" :class="{wrong: fault?.line === n}">{{ n }}</span></pre>
      <textarea ref="area" v-model="content" spellcheck="false" autocapitalize="off" wrap="off" :readonly="old" data-testid="cell-text-area" @scroll="$refs.lines.scrollTop = $event.target.scrollTop"></textarea></div>
    <div class="card fault" v-if="fault" role="alert" data-testid="cell-text-fault" style="margin:12px 0 0"><b>{{ fault.title }}</b> <span v-if="fault.line">{{ text.line }} {{ fault.line }}: </span><span>{{ fault.detail }}</span><div class="note" v-if="fault.hint">{{ fault.hint }}</div></div>
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
    async keep() {
      this.busy = true;
      const answer = await fetch(`/api/cells/${this.id}/text`, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ text: this.content, version: this.latest }) });
      if (answer.ok) location.href = `/?cell=${this.id}&edit=1`;
      else this.fault = await answer.json();
      this.busy = false;
    },
  },
};
