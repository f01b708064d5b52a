// The drawing of one team in one epoch and its look, the same in films and here.
//
// Written by viewer/make_playback.py from conevo/playback/schema.py, conevo/playback/look.py and
// conevo/palette.py, where everything is explained. Change those, not this file.

import type { Channel } from "./data";

export const SPEED = 60;
export const LEAST_BODY = 3.5;
export const LEAST_THING = 1.0;
export const KITE_TIP = 1.35;
export const KITE_SIDE = 0.95;
export const TRAIL = 120;
export const TRAIL_PIECES = 4;
export const TRAIL_OPACITY = 0.5;
export const JUMP = 0.5;
export const GONE_OPACITY = 0.12;
export const RING_FRAMES = 15;
export const RING_GROWTH = 14;
export const RANGE_FILL = 0.1;
export const RANGE_LINE = 0.35;
export const INK = "#1c1c22";
export const FAINT = "#9a9aa5";
export const GROUND = "#fbfaf7";
export const HUES = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00"] as const;

/** A name with a colour: an action, a caste, a type of thing, a kind of event. */
export interface Kind {
  readonly name: string;
  readonly colour: string;
}

/** An area that does not change. */
export interface Backdrop {
  readonly shape: "rect" | "disc" | "raster";
  readonly numbers: readonly number[];
  readonly fill: string;
  readonly line: string;
  readonly label: string;
  readonly cells: Channel | null;
}

/** The look of some bodies: "robot" bodies have the colour of their action or caste. */
export interface BodyKind {
  readonly name: string;
  readonly radius: number;
  readonly shape: "disc" | "square";
  readonly colour: string;
}

/** Rocks or objects. */
export interface Things {
  readonly name: string;
  readonly kinds: readonly Kind[];
  readonly kind: Channel;
  readonly x: Channel;
  readonly y: Channel;
  readonly size: number;
  readonly shape: "disc" | "square";
  readonly gone: Channel | null;
  readonly fade: number;
  readonly state: Channel | null;
  readonly states: readonly Kind[];
}

/** A range around the team's robots: [A] radius by the current action, 0 for none. */
export interface Ring {
  readonly name: string;
  readonly radius: readonly number[];
  readonly when: "action" | "selected";
  readonly of: "robots" | "others";
}

/** Sensors that belong together: ``count`` of them from number ``first`` on. */
export interface SensorGroup {
  readonly name: string;
  readonly first: number;
  readonly count: number;
  readonly names: readonly string[];
  readonly angles: readonly number[];
  readonly half: number;
  readonly reach: number;
  readonly turns: boolean;
}

/** A robot over the whole epoch. */
export interface Robot {
  readonly caste: number;
  readonly specialization: number;
  readonly fitness: number;
  readonly heuristic: string;
  readonly neurons: readonly number[];
  readonly favourite: string;
  readonly share: number;
}

/** An event to jump to. kind: index into the playback's event kinds; robots: numbers. */
export interface Event {
  readonly t: number;
  readonly kind: number;
  readonly text: string;
  readonly robots: readonly number[];
}

/** A complex object: kinds of its parts in order, and the iteration [parts] that built each. */
export interface PlanRow {
  readonly name: string;
  readonly is_ordered: boolean;
  readonly parts: readonly number[];
  readonly built: readonly number[];
}

/** A bar that moves with time: [T] between 0 and ``most``. */
export interface Gauge {
  readonly name: string;
  readonly values: Channel;
  readonly most: number;
  readonly colour: string;
}

/** A curve over the timeline: [T], the last value is that at the end of the epoch. */
export interface Curve {
  readonly name: string;
  readonly values: Channel;
}

/** One team in one epoch, ready to be drawn. The R robots are the first of the B bodies. */
export interface Playback {
  readonly title: string;
  readonly subtitle: string;
  readonly facts: readonly (readonly [string, string])[];
  readonly unit: string;
  readonly seconds: number;
  readonly bounds: readonly [number, number, number, number];
  readonly iterations: number;
  readonly actions: readonly Kind[];
  readonly castes: readonly Kind[];
  readonly robots: readonly Robot[];
  readonly body_kinds: readonly BodyKind[];
  readonly body: readonly number[];
  readonly x: Channel;
  readonly y: Channel;
  readonly action: Channel;
  readonly heading: Channel | null;
  readonly energy: Channel | null;
  readonly held: Channel | null;
  readonly sensors: Channel | null;
  readonly hidden: Channel | null;
  readonly outputs: Channel | null;
  readonly sensor_groups: readonly SensorGroup[];
  readonly output_names: readonly string[];
  readonly backdrop: readonly Backdrop[];
  readonly things: readonly Things[];
  readonly rings: readonly Ring[];
  readonly events: readonly Event[];
  readonly event_kinds: readonly Kind[];
  readonly plan: readonly PlanRow[];
  readonly gauges: readonly Gauge[];
  readonly measures: readonly Curve[];
}
