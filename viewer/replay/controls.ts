// Buttons, sliders and the legend.

import { find, make, named, say, swatch } from "../shared/dom";
import type { Clock } from "./clock";
import { FAINT, type Kind } from "./playback";
import { SPEEDS, type State, type Store } from "./state";

export class Controls {
  private readonly play = find("play", HTMLButtonElement);
  private readonly scrub = find("scrub", HTMLInputElement);
  private readonly time = find("time", HTMLElement);
  private readonly speed = find("speed", HTMLSelectElement);
  private readonly colour = find("colour", HTMLSelectElement);
  private readonly order = find("order", HTMLSelectElement);
  private readonly trails = find("trails", HTMLInputElement);
  private readonly ranges = find("ranges", HTMLInputElement);
  private readonly legend = find("legend", HTMLElement);

  constructor(
    private readonly store: Store,
    clock: Clock,
  ) {
    this.speed.append(...SPEEDS.map((value) => make("option", { value }, String(value))));
    this.scrub.max = String(store.length - 1);
    this.play.addEventListener("click", () => clock.toggle());
    const step = (by: number) => () => store.set({ t: store.now.t + by, playing: false });
    find("back", HTMLButtonElement).addEventListener("click", step(-1));
    find("step", HTMLButtonElement).addEventListener("click", step(1));
    this.scrub.addEventListener("input", () => store.set({ t: Number(this.scrub.value) }));
    this.speed.addEventListener("change", () => store.set({ speed: Number(this.speed.value) }));
    this.colour.addEventListener("change", () =>
      store.set({ colourBy: this.colour.value as State["colourBy"] }),
    );
    this.order.addEventListener("change", () =>
      store.set({ order: this.order.value as State["order"] }),
    );
    this.trails.addEventListener("change", () => store.set({ trails: this.trails.checked }));
    this.ranges.addEventListener("change", () => store.set({ ranges: this.ranges.checked }));
    this.update(store.now);
    this.fillLegend(store.now);
    store.listen((now, before) => {
      this.update(now);
      if (now.colourBy !== before.colourBy) this.fillLegend(now);
    });
  }

  private update(state: State): void {
    const { t, playing } = state;
    this.scrub.value = String(t);
    this.scrub.setAttribute("aria-valuetext", `iteration ${t}`);
    say(this.time, `iteration ${t} of ${this.store.length}`);
    this.play.classList.toggle("playing", playing);
    this.play.setAttribute("aria-label", playing ? "pause" : "play");
    this.speed.value = String(state.speed);
    this.colour.value = state.colourBy;
    this.order.value = state.order;
    this.trails.checked = state.trails;
    this.ranges.checked = state.ranges;
  }

  private fillLegend({ colourBy }: State): void {
    const kinds = new Map<string, Kind>();
    for (const playback of this.store.playbacks) {
      const all = colourBy === "action" ? playback.actions : playback.castes;
      for (const kind of all) kinds.set(`${kind.name} ${kind.colour}`, kind);
    }
    const entries = [...kinds.values()].map(({ name, colour }) => {
      const sign = swatch(colour || FAINT);
      sign.classList.add("disc");
      return make("li", {}, sign, named(name));
    });
    this.legend.replaceChildren(...entries);
  }
}
