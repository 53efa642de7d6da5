// What live page and playback share around a scene: theme, zoom buttons, legend, hover.

import {layersOf} from "./scene.js";

const at = id => document.getElementById(id);
const STORED = "planar-push";

const stored = () => { try { return JSON.parse(localStorage.getItem(STORED)) ?? {}; } catch { return {}; } };
const store = values => { try { localStorage.setItem(STORED, JSON.stringify({...stored(), ...values})); } catch { /* private */ } };

// scenes: all scenes of the page; model(): that of the first; soon(): draw again
export function setUp(scenes, model, soon) {
  const theme = stored().theme;
  if (theme) document.documentElement.dataset.theme = theme;
  at("theme").onclick = () => {
    const root = document.documentElement;
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    store({theme: root.dataset.theme}); soon();
  };
  const hidden = new Set(stored().hidden ?? []);
  for (const scene of scenes) scene.hidden = hidden;
  at("closer").onclick = () => { for (const s of scenes) s.zoom(model(), 1.4); soon(); };
  at("farther").onclick = () => { for (const s of scenes) s.zoom(model(), 1 / 1.4); soon(); };
  at("whole").onclick = () => { for (const s of scenes) s.whole(); soon(); };
  at("follow").onclick = () => {
    const follow = !scenes[0].follow;
    for (const s of scenes) { s.follow = follow; if (follow && s.camera.zoom < 2) s.camera = {...s.camera, zoom: 2}; }
    soon();
  };
  addEventListener("resize", soon);
  return {
    // metres: under the pointer, or null
    hover(metres) { at("cursor").textContent = metres ? `x ${metres.x.toFixed(3)}  y ${metres.y.toFixed(3)} m` : ""; },
    legend(chosen) {
      at("follow").setAttribute("aria-pressed", scenes[0].follow);
      const layers = layersOf(model(), chosen), key = JSON.stringify([[...layers], [...hidden]]);
      if (at("legend").dataset.key === key) return;
      at("legend").dataset.key = key;
      at("legend").replaceChildren(...[...layers].map(([name, colour]) => {
        const button = document.createElement("button"), dot = document.createElement("span");
        dot.className = "dot"; dot.style.background = colour || "currentColor";
        button.append(dot, name); button.setAttribute("aria-pressed", !hidden.has(name));
        button.title = "show or hide this layer";
        button.onclick = () => {
          if (!hidden.delete(name)) hidden.add(name);
          store({hidden: [...hidden]}); soon();
        };
        return button;
      }));
    },
  };
}
