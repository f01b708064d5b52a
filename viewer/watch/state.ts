// Data from the server: the state, and all generations of one run.

export type Values = (number | null)[];

export interface Summary {
  label: string;
  path: string;
  task: string;
  method: string;
  preset: string;
  seed: number | null;
  variant: string;
  status: string;
  reason: string;
  problem: string;
  stage: number; // of a shaping, from 1; 0 if it is none or none has begun
  n_stages: number;
  generation: number; // finished ones
  generations: number; // planned ones
  evaluations: number;
  budget: number; // evaluations, 0 for no limit
  seconds: number;
  share: number;
  ends_at: number | null; // seconds since 1970
  champion: number | null; // generation of the fittest team so far
  champion_stage: number; // in which it was, of a shaping; else 0
  performance: Record<string, number | null>;
  declared: Record<string, string>; // unit and direction of each
  fitness: number | null;
  best: number | null;
  specialization: number | null;
  sst: number | null;
  gst: number | null;
  castes: Record<string, number>;
  favourites: Record<string, number>; // robots by favourite setting; none in earlier logs
  favourite_share: number | null; // of the settings that a robot used, mean; 1: always the same
}

export interface Group {
  name: string;
  title: string;
  path: string;
  kind: string;
  running: boolean;
  ends_at: number | null;
  counts: Record<string, number>;
  problem: string;
}

export interface Row {
  series: string;
  of: number;
  status: Record<string, number>;
  performance: number | null;
  lowest: number | null;
  highest: number | null;
  fitness: number | null;
  specialization: number | null;
  evaluations: number | null;
}

export type Axis = "evaluations" | "generation";
export type Quantity = "performance" | "fitness";

export interface Curves {
  x: number[];
  lines: { label: string; series: string; performance: Values; fitness: Values }[];
  medians: {
    series: string;
    performance: Values;
    fitness: Values;
    performance_runs: number[]; // of how many runs each median is
    fitness_runs: number[];
  }[];
}

export interface Panel {
  group: string;
  task: string;
  preset: string;
  variant: string;
  by: string;
  measure: string;
  about: string; // its unit and which way is better
  larger_is_better: boolean;
  rows: Row[];
  over: Record<Axis, Curves>;
}

export interface State {
  version: number;
  title: string;
  reading: number;
  groups: Group[];
  runs: Summary[];
  panels: Panel[];
  methods: Record<string, { title: string; colour: string }>;
  castes: Record<string, Record<string, string>>;
  palette: string[];
}

export interface Details extends Summary {
  stages: { stage: number; task: string; first: number }[];
  number: number[];
  columns: Record<string, Values>;
  measures: Record<string, Values>;
  robots: Record<string, Values>;
}

/** Return the value of an object's own key. */
export function own<V>(object: Record<string, V>, key: string): V | undefined {
  return Object.hasOwn(object, key) ? object[key] : undefined;
}

/** Return the main measure of a run's task performance and its last value. */
export function main(run: Summary): [string, number | null] {
  return Object.entries(run.performance)[0] ?? ["", null];
}

/** Return the published name of a method. */
export function methodTitle(state: State, method: string): string {
  return own(state.methods, method)?.title ?? method;
}

/** Return the colour of a row of a panel. */
export function colourOf(state: State, panel: Panel, series: string): string {
  if (panel.by === "method") return own(state.methods, series)?.colour ?? "#1c1c22";
  const at = panel.rows.findIndex((row) => row.series === series);
  return state.palette[at % state.palette.length] ?? "#1c1c22";
}
