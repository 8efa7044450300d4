// Puts components where the page leaves places for them, and fills its parts that come later.
import { createApp } from "./vue/vue.esm-browser.prod.js";

async function mount(place) {
  const { default: component } = await import(`./components/${place.dataset.component}.js`);
  createApp(component, JSON.parse(place.dataset.props)).mount(place);
}

async function fill(place) {
  const address = new URL(location.href);
  address.searchParams.set("part", place.dataset.part);
  place.innerHTML = await window.bench.part(address);
  start(place);
}

function start(root) {
  root.querySelectorAll("[data-component]").forEach(mount);
  root.querySelectorAll("[data-part]").forEach(fill);
}

start(document);
