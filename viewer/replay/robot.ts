// One robot: numbers, sensors, activations, and the history of its actions.

import { make, say, swatch } from "../shared/dom";
import type { Channel } from "./data";
import { hue, Sheet } from "./paint";
import { FAINT, type Playback } from "./playback";
import type { State, Store } from "./state";

/** A value that changes with time, its text and its bar. */
interface Cell {
  readonly value: HTMLElement;
  readonly bar: HTMLElement | null;
  readonly read: (t: number, robot: number) => string;
  readonly part: (t: number, robot: number) => number;
}

export class RobotPanel {
  readonly element: HTMLElement;
  private robot = -1;
  private cells: Cell[] = [];
  private outputs: HTMLElement[] = [];
  private readonly history = new Sheet(make("canvas", { class: "history", role: "img" }), false);
  private readonly head = make("div", { class: "playhead" });

  constructor(
    private readonly playback: Playback,
    private readonly team: number,
    private readonly store: Store,
  ) {
    this.element = make("aside", {
      id: `robot-${team}`,
      class: "card robot",
      "aria-label": "robot",
    });
    this.build();
    store.listenSlowly((now) => this.update(now));
    this.history.canvas.addEventListener("pointerdown", (event) => this.seek(event));
    this.history.canvas.addEventListener("pointermove", (event) => this.seek(event));
  }

  private update(state: State): void {
    const robot = state.selected?.team === this.team ? state.selected.robot : -1;
    if (robot !== this.robot) {
      this.robot = robot;
      this.build();
    }
    if (robot < 0) return;
    const { t } = state;
    for (const { value, bar, read, part } of this.cells) {
      say(value, read(t, robot));
      bar?.style.setProperty("--part", part(t, robot).toFixed(3));
    }
    this.markHighest(t);
    this.head.style.left = `${(100 * (t + 0.5)) / this.playback.iterations}%`;
  }

  private build(): void {
    this.cells = [];
    this.outputs = [];
    const { playback, robot } = this;
    if (robot < 0) {
      const hint =
        "Click a robot in the world or its row in the timeline, or press the down arrow.";
      this.element.replaceChildren(make("h3", {}, "Robot"), make("p", { class: "note" }, hint));
      return;
    }
    const { caste } = playback.robots[robot]!;
    const close = make(
      "button",
      { type: "button", class: "plain", "aria-label": "deselect the robot" },
      "×",
    );
    close.addEventListener("click", () => this.store.set({ selected: null }));
    const title = make(
      "h3",
      {},
      swatch(playback.castes[caste]!.colour || FAINT),
      `Robot ${robot}`,
      close,
    );
    this.element.replaceChildren(
      title,
      this.numbers(robot),
      ...this.actions(robot),
      ...this.network(robot),
    );
    this.drawHistory();
  }

  private numbers(robot: number): HTMLElement {
    const { playback } = this;
    const one = playback.robots[robot]!;
    const numbers = make("dl", { class: "numbers" });
    const unit = playback.unit ? ` ${playback.unit}` : "";
    const add = (name: string, read: ((t: number, robot: number) => string) | string) => {
      const value = make("dd", { "data-field": name });
      if (typeof read === "string") value.textContent = read;
      else this.cells.push({ value, bar: null, read, part: () => 0 });
      numbers.append(make("div", {}, make("dt", {}, name), value));
    };
    add("action", (t, r) => playback.actions[playback.action.at(t, r)]?.name ?? "none");
    add("caste", playback.castes[one.caste]!.name);
    add("specialization", one.specialization.toFixed(3));
    const share = `${one.favourite}, ${(100 * one.share).toFixed(0)} %`;
    add("favourite", one.favourite ? share : "–");
    add("fitness", one.fitness.toFixed(Math.abs(one.fitness) < 1000 ? 3 : 1));
    if (playback.energy) add("energy", (t, r) => playback.energy!.at(t, r).toFixed(1));
    add("x", (t, r) => playback.x.at(t, r).toFixed(3) + unit);
    add("y", (t, r) => playback.y.at(t, r).toFixed(3) + unit);
    if (playback.heading)
      add("heading", (t, r) => `${degrees(playback.heading!.at(t, r)).toFixed(0)}°`);
    if (playback.held) add("holding", (t, r) => this.holding(t, r));
    return numbers;
  }

  private holding(t: number, robot: number): string {
    const k = this.playback.held!.at(t, robot);
    if (k < 0) return "nothing";
    const group = this.playback.things[0]!;
    return `${group.kinds[group.kind.at(k)]!.name} ${k}`;
  }

  /** Return the strip of the robot's actions and the share of each. */
  private actions(robot: number): HTMLElement[] {
    const { playback } = this;
    const counts = new Array<number>(playback.actions.length).fill(0);
    let [none, switches] = [0, 0];
    for (let t = 0; t < playback.iterations; t++) {
      const action = playback.action.at(t, robot);
      if (action < 0) none += 1;
      else counts[action]! += 1;
      if (t > 0 && action !== playback.action.at(t - 1, robot)) switches += 1;
    }
    const shares = make("ul", { class: "shares" });
    const add = (name: string, colour: string, n: number) => {
      const bar = make("i", { class: "bar" });
      bar.style.setProperty("--part", String(n / playback.iterations));
      bar.style.setProperty("--colour", colour);
      const share = `${((100 * n) / playback.iterations).toFixed(1)} %`;
      shares.append(make("li", {}, make("span", {}, name), bar, make("b", {}, share)));
    };
    playback.actions.forEach((kind, action) =>
      add(kind.name, kind.colour || FAINT, counts[action]!),
    );
    if (none) add("none", FAINT, none);
    const times = switches === 1 ? "1 switch" : `${switches} switches`;
    this.history.canvas.setAttribute("aria-label", `actions of robot ${robot} over time, ${times}`);
    const strip = make("div", { class: "strip" }, this.history.canvas, this.head);
    return [make("h4", {}, `Actions: ${times}`), strip, shares];
  }

  private drawHistory(): void {
    const { canvas, pen } = this.history;
    const [width, height] = [canvas.clientWidth || 300, 16];
    this.history.resize(width, height);
    for (let x = 0; x < width; x++) {
      const t = Math.floor(((x + 0.5) * this.playback.iterations) / width);
      pen.fillStyle =
        this.playback.actions[this.playback.action.at(t, this.robot)]?.colour || FAINT;
      pen.fillRect(x, 0, 1, height);
    }
  }

  private network(robot: number): HTMLElement[] {
    const { playback } = this;
    const { heuristic, neurons } = playback.robots[robot]!;
    if (heuristic) {
      const text = `Controlled by the heuristic ${heuristic}: it has no network.`;
      return [make("p", { class: "note" }, text), ...this.sensors()];
    }
    const parts = this.sensors();
    if (playback.hidden) {
      const names = neurons.map((slot) => `neuron ${slot}`);
      parts.push(
        make("h4", {}, "Hidden layer"),
        this.values("hidden", playback.hidden, names, neurons, FAINT),
      );
    }
    if (playback.outputs) {
      const names = Array.from(
        { length: playback.outputs.shape[2]! },
        (_, k) => playback.output_names[k] ?? `output ${k}`,
      );
      const all = names.map((_, k) => k);
      parts.push(
        make("h4", {}, "Outputs"),
        this.values("output", playback.outputs, names, all, FAINT),
      );
    }
    return parts;
  }

  private sensors(): HTMLElement[] {
    const { sensors, sensor_groups } = this.playback;
    if (!sensors) return [];
    return sensor_groups.flatMap((group, index) => {
      const title = make("h4", {}, `Sensors: ${group.name}`);
      // The colour is that of the wedges in the world.
      if (group.angles.length) title.prepend(swatch(hue(index)));
      const members = group.names.map((_, k) => group.first + k);
      return [title, this.values("sensor", sensors, group.names, members, hue(index))];
    });
  }

  /** Return a list of activations of some units, each with its bar. */
  private values(
    of: string,
    channel: Channel,
    names: readonly string[],
    units: readonly number[],
    colour: string,
  ): HTMLElement {
    const list = make("ul", { class: "values" });
    const [least, most] = channel.range();
    const extent = Math.max(-least, most, 1);
    units.forEach((unit, k) => {
      const name = names[k]!;
      const value = make("b", { [`data-${of}`]: unit });
      const bar = make("i", { class: "bar" });
      bar.style.setProperty("--colour", colour);
      const item = make("li", { title: name }, make("span", {}, name), bar, value);
      list.append(item);
      if (of === "output") this.outputs.push(item);
      this.cells.push({
        value,
        bar,
        read: (t, r) => channel.at(t, r, unit).toFixed(3),
        part: (t, r) => Math.min(Math.abs(channel.at(t, r, unit)) / extent, 1),
      });
    });
    return list;
  }

  /** Mark the highest output: it decides. */
  private markHighest(t: number): void {
    const { outputs } = this.playback;
    // Fewer outputs than actions are not votes, but wheel speeds.
    if (!outputs || !this.outputs.length || this.outputs.length < this.playback.actions.length)
      return;
    const values = this.outputs.map((_, k) => outputs.at(t, this.robot, k));
    // Several may be equally high, to the precision of stored values.
    const most = Math.max(...values);
    this.outputs.forEach((item, k) => item.classList.toggle("highest", values[k] === most));
  }

  private seek(event: PointerEvent): void {
    if (!(event.buttons & 1)) return;
    const box = this.history.canvas.getBoundingClientRect();
    const T = this.playback.iterations;
    this.store.set({ t: Math.floor(((event.clientX - box.left) / box.width) * T) });
  }
}

const degrees = (angle: number): number => ((((angle * 180) / Math.PI) % 360) + 360) % 360;
