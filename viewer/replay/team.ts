// One team: its world, the cards next to it, and its timeline.

import { make } from "../shared/dom";
import { Events } from "./events";
import { Marks } from "./marks";
import { RobotPanel } from "./robot";
import { cards } from "./side";
import type { Playback } from "./playback";
import type { Store } from "./state";
import { Timeline } from "./timeline";
import type { Tooltip } from "./tooltip";
import { World } from "./world";

/** When the cards next to the world move below it, as in the style sheet. */
const STACKED = "(max-width: 900px)";
/** Pixels next to the world that are left for the cards. */
const BESIDE = 250;
/** Tooltip of the column of S and castes. */
const DEGREE =
  "S: degree of specialization (0 = always the same action, 1 = switches all the time); caste by " +
  "S; share of the favourite setting in all that the robot used, in its colour (1 = always the " +
  "same one), which S does not measure";

export class Team {
  readonly element: HTMLElement;
  readonly world: World;
  readonly events: Events;
  readonly timeline: Timeline;
  private readonly marks: Marks;
  private readonly worldBox = make("div", { class: "world" });
  private readonly times: HTMLElement;
  private readonly head = make("div", { class: "playhead" });
  /** Of the timeline, in CSS pixels. */
  private width = 0;

  constructor(
    readonly playback: Playback,
    team: number,
    private readonly store: Store,
    tooltip: Tooltip,
  ) {
    const canvas = make("canvas", { id: `world-${team}`, role: "img" });
    canvas.setAttribute("aria-label", `the world of ${playback.title}, seen from above`);
    this.world = new World(canvas, playback, team, store, tooltip);
    this.timeline = new Timeline(playback, team, store, tooltip);
    this.marks = new Marks(playback, team, store, tooltip);
    this.events = new Events(playback, team, store);
    const panel = new RobotPanel(playback, team, store);

    const whole = make("button", { type: "button", class: "whole", hidden: true }, "whole world");
    whole.addEventListener("click", () => store.set({ look: store.whole }));
    this.worldBox.append(canvas, whole);
    const { key, gauges, plan, facts } = cards(playback, store);
    const about = make("div", {}, panel.element, key, facts);
    const side = make(
      "div",
      { class: "side" },
      about,
      make("div", {}, gauges, plan, this.events.element),
    );
    this.times = make(
      "div",
      { class: "times" },
      this.timeline.canvas,
      this.marks.canvas,
      this.head,
    );
    const { left, right } = this.timeline;
    const caption = make(
      "p",
      {},
      "Actions of every robot over the whole epoch; dark ticks: switches",
    );
    const ends = make("div", {}, right, this.marks.right);
    const lines = make(
      "div",
      { class: "lines" },
      make("i"),
      caption,
      make("p", { title: DEGREE }, "S, caste, favourite"),
      left,
      this.times,
      ends,
    );
    const title = make(
      "h2",
      {},
      make("b", {}, playback.title),
      make("span", {}, playback.subtitle),
    );
    this.element = make("section", { class: "team", "aria-label": playback.title }, title);
    this.element.append(this.worldBox, make("div", { class: "beside" }, side), lines);

    store.listen((now) => {
      this.world.draw(now);
      this.placeHead(now.t);
      whole.hidden = now.look.zoom <= 1;
    });
  }

  /** Move the playhead; by a transform, which lays nothing out again. */
  private placeHead(t: number): void {
    const x = (this.width * (t + 0.5)) / this.playback.iterations;
    this.head.style.transform = `translateX(${x.toFixed(1)}px)`;
  }

  /** Follow the sizes that the page gives; the first drawing comes with them. */
  watch(): void {
    const { element, worldBox, times, world, timeline, marks, playback } = this;
    const resize = () => {
      const isStacked = matchMedia(STACKED).matches;
      const room = times.parentElement!.clientWidth;
      const most = isStacked ? room : Math.max(room - BESIDE, room * 0.4);
      const { aspect } = world.view;
      const width = Math.max(Math.floor(Math.min(most, worldBox.clientHeight * aspect)), 1);
      const height = Math.max(Math.floor(width / aspect), 1);
      element.style.setProperty("--world", `${width}px`);
      world.canvas.style.width = `${width}px`;
      world.canvas.style.height = `${height}px`;
      world.resize(width, height);
    };
    const stretch = () => {
      const rows = playback.robots.length;
      const height = Math.min(Math.max(window.innerHeight * 0.18, 4 * rows), 16 * rows);
      const { width } = times.getBoundingClientRect();
      this.width = width;
      this.placeHead(this.store.now.t);
      timeline.canvas.style.height = `${Math.round(height)}px`;
      timeline.resize(width, Math.round(height));
      marks.canvas.style.height = `${marks.height}px`;
      marks.resize(width);
    };
    stretch();
    resize();
    new ResizeObserver(stretch).observe(times);
    const observer = new ResizeObserver(resize);
    for (const one of [worldBox, times]) observer.observe(one);
  }
}
