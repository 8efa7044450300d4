// A place to drop files on: each goes to /api/files as it is, then what came of it to one address.
export default {
  template: `
  <div>
    <label class="drop-zone" :class="{over}" @dragover.prevent="over = true" @dragleave="over = false" @drop.prevent="dropped">
      <input type="file" multiple :accept="accept" data-testid="file-input" @change="chosen">
      <b>{{ title }}</b><span>{{ hint }}</span>
      <div class="progress" style="width:min(340px,80%)" v-if="share !== null"><i :style="{width: 100 * share + '%'}"></i></div>
    </label>
    <div class="card fault" v-if="fault" data-testid="upload-fault" role="alert" style="margin-top:12px" v-html="said(fault)"></div>
  </div>`,
  props: { title: String, hint: String, accept: String, then: String, facts: Object, go: String },
  data: () => ({ over: false, share: null, fault: null }),
  methods: {
    said: (fault) => window.bench.fault(fault),
    chosen(e) { this.take([...e.target.files]); e.target.value = ""; },
    dropped(e) { this.over = false; this.take([...e.dataTransfer.files]); },
    async take(files) {
      if (!files.length) return;
      this.fault = null;
      try {
        const ids = [];
        for (const [k, file] of files.entries()) {
          this.share = k / files.length;
          const sent = await window.bench.send(`/api/files?name=${encodeURIComponent(file.name)}`, file, (s) => (this.share = (k + s) / files.length));
          ids.push(sent.id);
        }
        if (!this.then) location.href = this.go.replace("{id}", ids.join(","));
        else {
          const answer = await fetch(this.then, { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ ...this.facts, uploads: ids }) });
          const made = await answer.json();
          if (!answer.ok) throw made;
          window.bench.own(made.id); // if it is a job
          location.href = this.go.replace("{id}", made.id);
        }
      } catch (cause) {
        this.fault = cause;
      }
      this.share = null;
    },
  },
};
