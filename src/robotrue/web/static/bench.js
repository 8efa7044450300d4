// What every page needs in the browser: choices kept in a cookie, shortcuts, files sent as they are.
"use strict";
(() => {
  const COOKIE = "robotrue_view";
  const read = () => {
    const found = document.cookie.split("; ").find((c) => c.startsWith(COOKIE + "="));
    return new URLSearchParams(found ? decodeURIComponent(found.slice(COOKIE.length + 1)) : "");
  };
  const theme = () => {
    const wanted = read().get("theme");
    const dark = wanted === "dark" || (wanted !== "light" && matchMedia("(prefers-color-scheme: dark)").matches);
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    window.dispatchEvent(new CustomEvent("bench-theme"));
  };
  theme();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", theme);

  const prefer = (name, value) => {
    const chosen = read();
    chosen.set(name, value);
    const secure = location.protocol === "https:" ? "; Secure" : "";
    document.cookie = `${COOKIE}=${encodeURIComponent(chosen)}; Path=/; SameSite=Strict; Max-Age=31536000${secure}`;
    if (name === "theme") theme();
    else location.reload();
  };

  // Sends one file as the body of a request; the server writes it to disk as it comes.
  const send = (url, file, onProgress) =>
    new Promise((resolve, reject) => {
      const request = new XMLHttpRequest();
      request.open("POST", url);
      request.setRequestHeader("Content-Type", "application/octet-stream");
      request.upload.onprogress = (e) => e.lengthComputable && onProgress && onProgress(e.loaded / e.total);
      request.onload = () => {
        let answer = {};
        try { answer = JSON.parse(request.responseText); } catch { answer = { detail: request.responseText }; }
        if (request.status < 300) resolve(answer);
        else reject(answer);
      };
      request.onerror = () => reject({ title: "no connection" });
      request.onabort = request.onerror;
      request.send(file);
    });

  const typing = (e) => e.target.closest("input, textarea, select, [contenteditable]");
  addEventListener("keydown", (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || typing(e)) return;
    if (e.key >= "1" && e.key <= "9") {
      const link = document.querySelector(`[data-shortcut="${e.key}"]`);
      if (link) location.href = link.href;
    } else if (e.key === "?") {
      document.getElementById("shortcuts")?.showModal();
    } else if (e.key === "t") {
      prefer("theme", document.documentElement.dataset.theme === "dark" ? "light" : "dark");
    }
  });
  // A menu that is open closes with a click elsewhere, and with Escape.
  addEventListener("click", (e) => {
    document.querySelectorAll("details.menu[open]").forEach((m) => m.contains(e.target) || (m.open = false));
  });
  addEventListener("keydown", (e) => {
    if (e.key === "Escape") document.querySelectorAll("details.menu[open]").forEach((m) => (m.open = false));
  });
  // Rows that lead somewhere: to a page, or to a point of the 3-D view.
  const follow = (row) => {
    if (row.dataset.href) location.href = row.dataset.href;
    else if (row.dataset.point) {
      (row.closest("svg") ?? row.parentElement).querySelectorAll(".chosen").forEach((r) => r.classList.remove("chosen"));
      row.classList.add("chosen");
      dispatchEvent(new CustomEvent("bench-select", { detail: Number(row.dataset.point) }));
    }
  };
  addEventListener("click", (e) => {
    const row = e.target.closest("tr[data-href], [data-point]");
    if (row && !e.target.closest("a, button, input")) follow(row);
  });
  addEventListener("keydown", (e) => {
    if (e.key === "Enter" && e.target.matches?.("tr[data-href], tr[data-point]")) follow(e.target);
  });
  // A point under the pointer in a chart is marked in the 3-D view, and the other way round.
  const hover = (point) => dispatchEvent(new CustomEvent("bench-hover", { detail: point }));
  addEventListener("pointerover", (e) => {
    const dot = e.target.closest?.("svg [data-point]");
    if (dot) hover(Number(dot.dataset.point));
    else if (e.target.closest?.("svg.residuals")) hover(null);
  });
  addEventListener("pointerout", (e) => e.target.closest?.("svg.residuals") && !e.relatedTarget?.closest?.("svg.residuals") && hover(null));
  // Charts of many points draw some of them: the nearest one before stands for the others.
  const near = (chart, point) => {
    let best = -1;
    for (const dot of chart.querySelectorAll("circle[data-point]")) {
      const at = Number(dot.dataset.point);
      if (at <= point && at > best) best = at;
    }
    return best;
  };
  for (const [event, look] of [["bench-hover", "near"], ["bench-picked", "chosen"], ["bench-select", "chosen"]]) {
    addEventListener(event, ({ detail }) => {
      for (const chart of document.querySelectorAll("svg.residuals")) {
        chart.querySelectorAll(`.${look}`).forEach((dot) => dot.classList.remove(look));
        if (detail === null) continue;
        const best = near(chart, detail);
        chart.querySelectorAll(`circle[data-point="${best}"]`).forEach((dot) => dot.classList.add(look));
      }
    });
  }
  const plain = (text) => String(text ?? "").replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
  // A refusal as HTML: its kind and what helps in the reader's language, the detail as it came (faults.py).
  const fault = (found) => {
    const words = JSON.parse(document.getElementById("fault-words").textContent);
    const away = found instanceof Error;
    const kind = away ? "no connection" : found.title ?? (found.kind ?? "").replace(/(?!^)([A-Z])/g, " $1").toLowerCase();
    const known = words.kinds[kind] ?? words.kinds.other;
    const file = String(found.source ?? "").split(/[\\/]/).pop();
    const place = file || found.line ? `${file || ""}${found.line ? `:${found.line}` : ""}: ` : "";
    const hint = (words.commands ?? []).some((each) => found.hint?.startsWith(each)) ? "" : found.hint;
    const said = away ? "" : found.detail ?? found.message ?? "";
    const head = `<b>${plain(known?.title ?? kind)}</b> `;
    const note = (label, text) => (text ? `<div class="note">${plain(label)} <span lang="en">${plain(text)}</span></div>` : "");
    if (!said) return head + plain(known?.do);
    if (words.plain) return head + plain(place + said) + (hint ? `<div class="note">${plain(hint)}</div>` : "");
    return head + plain(known?.do) + note(words.english, place + said) + note(words.try, hint);
  };
  // Shows a refusal under what was pressed, in place of the one before.
  const tell = (near, found) => {
    const place = near?.closest(".card, .head, form") ?? document.querySelector(".sheet").firstElementChild;
    document.querySelectorAll("[data-testid=refused]").forEach((each) => each.remove());
    const card = document.createElement("div");
    Object.assign(card, { className: "card fault", innerHTML: fault(found) });
    card.setAttribute("role", "alert");
    card.dataset.testid = "refused";
    card.style.marginTop = "12px";
    place.after(card);
    card.scrollIntoView({ block: "nearest" });
  };
  // Returns the answer of the interface as JSON; throws a refusal, or the error of a server that is away.
  const ask = async (method, url, body) => {
    const sent = body === undefined ? {} : { headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
    const answer = await fetch(url, { method, ...sent });
    const found = answer.status === 204 ? {} : await answer.json().catch(() => ({ title: "other" }));
    if (!answer.ok) throw found;
    return found;
  };
  // Does what a button asks for; while it goes on the button cannot be pressed again.
  const pressed = async (button, work) => {
    if (button) button.disabled = true;
    try { await work(); } catch (cause) {
      tell(button, cause);
      if (button) button.disabled = false;
    }
  };
  // The job asked for last in this tab, which is the one that leads away; kept over a reload.
  const own = (id) => {
    if (id !== undefined) sessionStorage.setItem("bench-job", id);
    return sessionStorage.getItem("bench-job");
  };
  // Asks for a job; the page shows it when it comes again.
  const job = (kind, parameters, button) =>
    pressed(button, async () => {
      own((await ask("POST", "/api/jobs", { kind, parameters })).id);
      location.reload();
    });
  // The values of a form; a name that ends in [] is a list, a checked box true, a file is sent and named by its upload, data-key is stated with the value.
  const stated = async (form) => {
    const found = {}, bar = form.querySelector("[data-progress]");
    const put = (name, value) => (name.endsWith("[]") ? (found[name.slice(0, -2)] ??= []).push(value) : (found[name] = value));
    const shown = (share) => bar && ((bar.hidden = false), (bar.firstElementChild.style.width = `${100 * share}%`));
    for (const field of form.elements) {
      const { name, type, value } = field;
      if (!name || field.disabled || type === "submit" || type === "button") continue;
      if (type === "file") {
        for (const file of field.files) put(name, { upload: (await send(`/api/files?name=${encodeURIComponent(file.name)}`, file, shown)).id });
      } else if (type === "checkbox") {
        if (field.checked) put(name, name.endsWith("[]") ? value : true);
        else if (field.defaultChecked && !name.endsWith("[]")) put(name, false);
      } else if (type === "select-multiple") {
        for (const option of field.selectedOptions) put(name, "json" in field.dataset ? JSON.parse(option.value) : option.value);
      } else if (value !== "" && field.dataset.key) put(name, `${field.dataset.key}=${value}`);
      else if (value !== "" && (type !== "radio" || field.checked)) put(name, type === "number" ? Number(value) : "json" in field.dataset ? JSON.parse(value) : value);
    }
    return found;
  };
  // A form whose fields are the parameters of a job.
  const jobForm = (kind, form) => {
    const button = form.querySelector("button");
    const unpicked = [...form.querySelectorAll("[data-least]")].find((each) => !each.querySelector(":checked"));
    if (unpicked) tell(button, { title: "invalid request", detail: unpicked.dataset.least });
    else pressed(button, async () => job(kind, await stated(form), button));
  };
  // Makes something of what is on the page, then opens it.
  const make = (url, body, go, button) =>
    pressed(button, async () => (location.href = go.replace("{id}", (await ask("POST", url, body)).id)));
  // Takes back the version that was seen; if somebody else has done so, it is not turned round again.
  const undo = (noun, id, button, version) =>
    pressed(button, async () => {
      const answer = await fetch(`/api/items/${noun}/${id}/undo?version=${version}`, { method: "POST" });
      if (!answer.ok && answer.status !== 409) throw await answer.json();
      location.reload();
    });
  // The model all pages show from now on; null: the newest again. The one named in this page's address goes.
  const chooseModel = (id, button) =>
    pressed(button, async () => {
      await (id ? ask("PUT", "/api/chosen-model", { model: id }) : ask("DELETE", "/api/chosen-model"));
      const here = new URL(location.href);
      here.searchParams.delete("model");
      if (here.href === location.href) location.reload();
      else location.href = here.href;
    });
  // Deletes an item; one that somebody else has deleted is gone all the same.
  const remove = (noun, id, go, button) =>
    pressed(button, async () => {
      const answer = await fetch(`/api/items/${noun}/${id}`, { method: "DELETE" });
      if (answer.status >= 500) throw await answer.json();
      location.href = go;
    });
  // Name and note of an item, changed in place: a new version, and the one before comes back.
  const rename = ({ noun, id, version, name, note, text }) => {
    const dialog = document.createElement("dialog");
    dialog.dataset.testid = "naming";
    dialog.innerHTML = `<form method="dialog" style="display:grid;gap:12px;width:min(460px,80vw)"><h2></h2>
      <label class="field"><span></span><input type="text" name="name" maxlength="200" required data-testid="naming-name"></label>
      <label class="field"><span></span><textarea name="note" rows="4" maxlength="2000" data-testid="naming-note"></textarea></label>
      <p class="bad" role="alert" data-testid="naming-fault" style="color:var(--bad)"></p>
      <div style="display:flex;flex-wrap:wrap;gap:8px"><button class="act" value="keep" data-testid="naming-keep"></button>
      <button type="button" class="act quiet" data-testid="naming-before"></button><button type="button" class="act quiet"></button></div></form>`;
    const form = dialog.firstElementChild, [keep, before, close] = form.querySelectorAll("button");
    form.querySelector("h2").textContent = text.edit;
    form.querySelectorAll("label span").forEach((each, k) => (each.textContent = [text.name, text.note][k]));
    [keep, before, close].forEach((each, k) => (each.textContent = [text.keep, text.before, text.close][k]));
    form.elements.name.value = name;
    form.elements.note.value = note;
    before.hidden = version < 2;
    before.onclick = () => undo(noun, id, before, version);
    close.onclick = () => dialog.close();
    dialog.onclose = () => dialog.remove();
    form.onsubmit = async (e) => {
      e.preventDefault();
      keep.disabled = true;
      try {
        await ask("PATCH", `/api/items/${noun}/${id}`, { name: form.elements.name.value, note: form.elements.note.value });
        location.reload();
      } catch (cause) {
        form.querySelector("[role=alert]").innerHTML = fault(cause);
        keep.disabled = false;
      }
    };
    document.body.append(dialog);
    dialog.showModal();
  };
  // A part of this page that comes later, as HTML.
  const part = async (address) => {
    try {
      const answer = await fetch(address);
      if (answer.redirected) location.reload(); // logged out meanwhile
      if (answer.ok) return await answer.text();
      throw await answer.json();
    } catch (cause) { return `<div class="card fault" role="alert" data-testid="fault">${fault(cause)}</div>`; }
  };
  // What a press does: data-act of a button; data-job and data-make of a form; data-prefer and data-submit of a choice.
  const ACTS = {
    theme: () => prefer("theme", document.documentElement.dataset.theme === "dark" ? "light" : "dark"),
    shortcuts: () => document.getElementById("shortcuts").showModal(),
    "choose-model": (b) => chooseModel(b.dataset.id ?? null, b),
    undo: (b) => undo(b.dataset.noun, b.dataset.id, b, b.dataset.version),
    remove: (b) => remove(b.dataset.noun, b.dataset.id, b.dataset.go, b),
    rename: (b) => rename(JSON.parse(b.dataset.item)),
    job: (b) => job(b.dataset.kind, JSON.parse(b.dataset.parameters), b),
    make: (b) => make(b.dataset.url, JSON.parse(b.dataset.body), b.dataset.go, b),
  };
  addEventListener("click", (e) => {
    const button = e.target.closest("[data-act]");
    if (button) ACTS[button.dataset.act](button);
  });
  addEventListener("submit", (e) => {
    const { job: kind, make: url, go } = e.target.dataset;
    if (!kind && !url) return;
    e.preventDefault();
    if (kind) jobForm(kind, e.target);
    else make(url, Object.fromEntries(new FormData(e.target)), go, e.target.querySelector("button"));
  });
  addEventListener("change", (e) => {
    if (e.target.dataset.prefer) prefer(e.target.dataset.prefer, e.target.value);
    else if ("submit" in e.target.dataset) e.target.form.requestSubmit();
  });
  window.bench = { ask, fault, job, own, part, plain, read, send };
})();
