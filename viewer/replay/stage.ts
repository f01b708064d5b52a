// One team in one epoch, ready to be drawn: what conevo/replay/stage.py says, field by field.
//
// Frame t, from 0 to T - 1, is the state after iteration t. Lengths are in the world's unit, y
// points up, angles are in rad counter-clockwise from +x.

import { type Channel, Damaged, type Pool } from "./data";
import * as read from "./read";

const kind = read.object({ name: read.text, colour: read.colour });
/** A name with a colour: an action, a caste, a type of thing, a kind of event. */
export type Kind = read.Of<typeof kind>;

const backdrop = read.object({
  shape: read.oneOf("rect", "disc", "raster"),
  numbers: read.list(read.number),
  fill: read.colour,
  line: read.colour,
  label: read.text,
  cells: read.maybe(read.channel),
});
/** What stands still. */
export type Backdrop = read.Of<typeof backdrop>;

const bodyKind = read.object({
  name: read.text,
  radius: read.length,
  shape: read.oneOf("disc", "square"),
  colour: read.colour,
});
/** How some bodies look; no colour means that of the robot's action or caste. */
export type BodyKind = read.Of<typeof bodyKind>;

const things = read.object({
  name: read.text,
  kinds: read.list(kind),
  kind: read.channel,
  x: read.channel,
  y: read.channel,
  size: read.length,
  shape: read.oneOf("square", "disc"),
  gone: read.maybe(read.channel),
  fade: read.length,
  state: read.maybe(read.channel),
  states: read.list(kind),
});
/** Rocks or objects: x, y [K] or [T, K], gone [K], state [T, K]. */
export type Things = read.Of<typeof things>;

const ring = read.object({
  name: read.text,
  radius: read.list(read.length),
  when: read.oneOf("action", "selected"),
  of: read.oneOf("robots", "others"),
});
/** A range around robots: [A] radius by the action of the moment. */
export type Ring = read.Of<typeof ring>;

const sensorGroup = read.object({
  name: read.text,
  first: read.count,
  count: read.count,
  names: read.list(read.text),
  angles: read.list(read.number),
  half: read.length,
  reach: read.length,
  turns: read.yes,
});
/** Sensors that belong together, and where each of them looks. */
export type SensorGroup = read.Of<typeof sensorGroup>;

const robot = read.object({
  caste: read.count,
  specialization: read.number,
  fitness: read.number,
  heuristic: read.text,
  neurons: read.list(read.count),
  favourite: read.text,
  share: read.length,
});
/** What is said about a robot over the whole epoch. */
export type Robot = read.Of<typeof robot>;

const event = read.object({
  t: read.count,
  kind: read.count,
  text: read.text,
  robots: read.list(read.count),
});
/** Something to jump to. */
export type Event = read.Of<typeof event>;

const planRow = read.object({
  name: read.text,
  is_ordered: read.yes,
  parts: read.list(read.count),
  built: read.list(read.count),
});
/** A complex object: kinds of its parts in order, and the iteration that built each (T: none). */
export type PlanRow = read.Of<typeof planRow>;

const gauge = read.object({
  name: read.text,
  values: read.channel,
  most: read.number,
  colour: read.colour,
});
/** A bar that moves with time. */
export type Gauge = read.Of<typeof gauge>;

const measure = read.object({ name: read.text, values: read.channel });
/** A curve over the timeline. */
export type Measure = read.Of<typeof measure>;

const stage = read.object({
  title: read.text,
  subtitle: read.text,
  facts: read.list(read.list(read.text, 2)),
  unit: read.text,
  seconds: read.number,
  bounds: read.list(read.number, 4),
  iterations: read.count,
  actions: read.list(kind),
  castes: read.list(kind),
  robots: read.list(robot),
  body_kinds: read.list(bodyKind),
  body: read.list(read.count),
  x: read.channel,
  y: read.channel,
  action: read.channel,
  heading: read.maybe(read.channel),
  energy: read.maybe(read.channel),
  held: read.maybe(read.channel),
  sensors: read.maybe(read.channel),
  hidden: read.maybe(read.channel),
  outputs: read.maybe(read.channel),
  sensor_groups: read.list(sensorGroup),
  output_names: read.list(read.text),
  backdrop: read.list(backdrop),
  things: read.list(things),
  rings: read.list(ring),
  events: read.list(event),
  event_kinds: read.list(kind),
  plan: read.list(planRow),
  gauges: read.list(gauge),
  measures: read.list(measure),
});
/** One team in one epoch. Robots come first among the bodies. */
export type Stage = read.Of<typeof stage>;

/** Return the stages of a page's JSON, one or two. Throws Damaged. */
export function readStages(json: string, pool: Pool): Stage[] {
  let about: unknown;
  try {
    about = JSON.parse(json);
  } catch {
    throw new Damaged("its description is not JSON");
  }
  const page = read.object({ format: read.whole, teams: read.list((part) => part) });
  const { format, teams } = page(about, "the page", pool);
  if (format !== 1) throw new Damaged(`its format is ${format}, this page reads format 1`);
  const stages = teams.map((team, k) => stage(team, `team ${k}`, pool));
  if (stages.length < 1 || stages.length > 2) throw new Damaged(`it has ${stages.length} teams`);
  stages.forEach((one, k) => check(one, `team ${k}`));
  if (new Set(stages.map((one) => one.iterations)).size > 1) {
    throw new Damaged("its teams lived for different numbers of iterations");
  }
  return stages;
}

/** Throw Damaged unless all numbers of a stage fit each other: drawing asks no more questions. */
function check(stage: Stage, where: string): void {
  const { iterations: T, robots, body, castes, actions } = stage;
  const [R, B] = [robots.length, body.length];
  const demand = (holds: boolean, what: string) => {
    if (!holds) throw new Damaged(`${where}: ${what}`);
  };
  const shaped = (channel: Channel | null, name: string, ...sizes: (number | null)[]) => {
    if (!channel) return;
    const fits = sizes.every((size, k) => size === null || size === channel.shape[k]);
    demand(fits && channel.shape.length === sizes.length, `${name} has the wrong shape`);
  };
  const within = (channel: Channel, name: string, low: number, high: number) => {
    const [least, most] = channel.range();
    const fits = channel.step === 1 && Number.isInteger(channel.low) && least >= low && most < high;
    demand(fits || !channel.codes.length, `${name} has an impossible value`);
  };

  demand(T > 0 && R > 0 && B >= R, "it has no iterations or no robots");
  const [x0, y0, x1, y1] = stage.bounds as [number, number, number, number];
  demand(x0 < x1 && y0 < y1, "its world has no extent");
  demand(
    body.every((kind) => kind < stage.body_kinds.length),
    "a body has no kind",
  );
  demand(
    robots.every((one) => one.caste < castes.length),
    "a robot has no caste",
  );
  shaped(stage.x, "x", T, B);
  shaped(stage.y, "y", T, B);
  shaped(stage.heading, "heading", T, null);
  demand((stage.heading?.shape[1] ?? R) >= R, "heading has the wrong shape");
  shaped(stage.action, "action", T, R);
  within(stage.action, "action", -1, actions.length);
  shaped(stage.energy, "energy", T, R);
  shaped(stage.sensors, "sensors", T, R, null);
  shaped(stage.hidden, "hidden", T, R, null);
  shaped(stage.outputs, "outputs", T, R, null);
  const slots = stage.hidden?.shape[2] ?? Infinity;
  demand(
    robots.every((one) => one.heuristic || one.neurons.every((slot) => slot < slots)),
    "a robot has neurons that nobody has recorded",
  );

  for (const group of stage.things) {
    const K = group.kind.shape[0] ?? 0;
    shaped(group.kind, "kinds of things", K);
    within(group.kind, "kinds of things", 0, group.kinds.length);
    for (const axis of [group.x, group.y]) {
      if (axis.shape.length === 1) shaped(axis, "places of things", K);
      else shaped(axis, "places of things", T, K);
    }
    shaped(group.gone, "ends of things", K);
    shaped(group.state, "states of things", T, K);
    if (group.state) within(group.state, "states of things", 0, group.states.length);
  }
  if (stage.held) {
    shaped(stage.held, "held things", T, R);
    within(stage.held, "held things", -1, stage.things[0]?.kind.shape[0] ?? 0);
  }
  for (const part of stage.backdrop) {
    const n = part.shape === "disc" ? 3 : 4;
    demand(part.numbers.length === n, "a part of the world has the wrong shape");
    if (part.shape === "raster") {
      demand(part.cells !== null, "a part of the world has no cells");
      shaped(part.cells, "a part of the world", null, null);
    }
  }
  const S = stage.sensors?.shape[2] ?? 0;
  for (const group of stage.sensor_groups) {
    const fits =
      group.names.length === group.count && [0, group.count].includes(group.angles.length);
    demand(fits && (!stage.sensors || group.first + group.count <= S), "sensors do not fit");
  }
  demand(
    stage.rings.every((one) => one.radius.length >= actions.length),
    "a ring does not fit",
  );
  for (const event of stage.events) {
    const fits = event.t < T && event.kind < stage.event_kinds.length;
    demand(fits && event.robots.every((r) => r < B), "an event does not fit");
  }
  for (const row of stage.plan) {
    const kinds = stage.things[0]?.kinds.length ?? 0;
    const fits = row.parts.length === row.built.length && row.parts.every((part) => part < kinds);
    demand(fits, "the plan does not fit");
  }
  for (const one of [...stage.gauges, ...stage.measures]) shaped(one.values, one.name, T);
}
