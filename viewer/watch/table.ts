// All runs in a table that can be sorted and filtered; only rows that change are written again.

import { find, make, say } from "../shared/dom";
import { FAINT } from "./chart";
import { main, methodTitle, own, type State, type Summary } from "./state";
import { count, left, number, STATES } from "./text";

type Cell = Node | string;
interface Column {
  name: string;
  value: (run: Summary, state: State) => number | string | null;
  cell: (run: Summary, state: State) => Cell;
  isNumber?: boolean;
}

/** Whether its budget will end a run, or did, before its last generation. */
function endsByBudget(run: Summary): boolean {
  return run.budget > 0 && run.evaluations / run.budget > run.generation / run.generations;
}

/** Return the progress of a run: its generations, or its budget if that will end it. */
export function place(run: Summary): string {
  const stage = run.n_stages ? `stage ${run.stage} of ${run.n_stages}, ` : "";
  if (!run.generations) return "";
  if (endsByBudget(run)) {
    return `${stage}generation ${run.generation}, ${count(run.evaluations)} of ${count(run.budget)} evaluations`;
  }
  return `${stage}generation ${run.generation} of ${run.generations}`;
}

/** Return a state with its mark. */
export function badge(status: string): HTMLElement {
  const known = STATES.includes(status) ? status : "pending";
  return make("span", { class: `status ${known}` }, status);
}

/** Return a bar of a team's castes, in the order and the colours of its world. */
export function casteBar(run: Summary, state: State): HTMLElement {
  const colours = own(state.castes, run.task.split("/")[0] ?? "") ?? {};
  const size = Object.values(run.castes).reduce((sum, n) => sum + n, 0);
  const names = Object.keys(colours).filter((name) => own(run.castes, name));
  const text = names.map((name) => `${name} ${run.castes[name]}`).join(", ");
  const bar = make("span", { class: "castes", title: text, role: "img", "aria-label": text });
  for (const name of names) {
    const part = make("i");
    part.style.background = own(colours, name) ?? FAINT;
    part.style.width = `${(100 * (run.castes[name] ?? 0)) / size}%`;
    bar.append(part);
  }
  return bar;
}

/** Return a bar for the share of a run that is over. */
export function progressBar(run: Summary): HTMLElement {
  const bar = make("span", { class: "progress", title: place(run) });
  const part = make("i");
  part.style.width = `${100 * run.share}%`;
  bar.append(part);
  return bar;
}

const COLUMNS: Column[] = [
  { name: "run", value: (r) => r.label, cell: (r) => make("a", { href: `#${encodeURIComponent(r.label)}` }, r.label) },
  { name: "method", value: (r, s) => methodTitle(s, r.method), cell: (r, s) => methodTitle(s, r.method) },
  { name: "status", value: (r) => STATES.indexOf(r.status), cell: (r) => badge(r.status) },
  { name: "progress", value: (r) => r.share, cell: progressBar },
  {
    name: "generation",
    value: (r) => r.generation,
    cell: (r) => (r.generations ? `${r.generation}${endsByBudget(r) ? "" : `/${r.generations}`}` : ""),
    isNumber: true,
  },
  { name: "time left", value: (r) => r.ends_at, cell: (r) => left(r.ends_at), isNumber: true },
  { name: "performance", value: (r) => main(r)[1], cell: (r) => number(main(r)[1]), isNumber: true },
  { name: "fitness", value: (r) => r.fitness, cell: (r) => number(r.fitness), isNumber: true },
  { name: "S", value: (r) => r.specialization, cell: (r) => number(r.specialization), isNumber: true },
  { name: "castes", value: (r) => r.castes["non-specialized"] ?? 0, cell: casteBar },
];

/** The table of all runs. */
export class Table {
  private readonly rows = new Map<string, { row: HTMLTableRowElement; key: string; run: Summary }>();
  private readonly body: HTMLTableSectionElement;
  private readonly filter = find("filter", HTMLInputElement);
  private readonly found = find("found", HTMLElement);
  private readonly heads: HTMLElement[];
  private sorted = -1;
  private sign = 1;
  private order = "";
  private state: State | null = null;

  constructor(private readonly show: (label: string) => void) {
    const table = find("runs", HTMLTableElement);
    this.body = table.tBodies[0] as HTMLTableSectionElement;
    this.heads = COLUMNS.map((column, k) => {
      const button = make("button", { type: "button", onclick: () => this.sort(k) }, column.name);
      return make("th", { scope: "col", class: column.isNumber ? "number" : "" }, button);
    });
    table.tHead?.append(make("tr", {}, ...this.heads));
    this.filter.addEventListener("input", () => this.arrange());
    this.body.addEventListener("click", (event) => {
      const label = (event.target as Element).closest("tr")?.dataset.label;
      if (label !== undefined) this.show(label);
    });
  }

  draw(state: State): void {
    this.state = state;
    const labels = new Set(state.runs.map((run) => run.label));
    for (const [label, { row }] of this.rows) {
      if (!labels.has(label)) {
        row.remove();
        this.rows.delete(label);
      }
    }
    for (const run of state.runs) {
      const colours = own(state.castes, run.task.split("/")[0] ?? "");
      const key = JSON.stringify([run, left(run.ends_at), colours]);
      const known = this.rows.get(run.label);
      if (known?.key === key) continue;
      const row = known?.row ?? make("tr", { "data-label": run.label });
      row.replaceChildren(...COLUMNS.map((column) => this.cell(column, run, state)));
      this.rows.set(run.label, { row, key, run });
    }
    this.arrange();
  }

  /** Mark the run whose details are shown. */
  select(label: string | null): void {
    for (const [name, { row }] of this.rows) row.classList.toggle("selected", name === label);
  }

  private cell(column: Column, run: Summary, state: State): HTMLElement {
    const cell = make("td", { class: column.isNumber ? "number" : "" }, column.cell(run, state));
    const problem = run.problem || run.reason;
    if (column.name === "run" && problem) cell.append(make("small", { class: "alert" }, problem));
    return cell;
  }

  private sort(column: number): void {
    this.sign = this.sorted === column ? -this.sign : 1;
    this.sorted = column;
    this.heads.forEach((head, k) =>
      k === column
        ? head.setAttribute("aria-sort", this.sign > 0 ? "ascending" : "descending")
        : head.removeAttribute("aria-sort"),
    );
    this.arrange();
  }

  /** Sort the rows, and hide those that the filter excludes. */
  private arrange(): void {
    const { state } = this;
    if (!state) return;
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    const runs = state.runs.map((run) => this.rows.get(run.label)?.run ?? run);
    const column = COLUMNS[this.sorted];
    if (column) {
      const value = (run: Summary) => column.value(run, state);
      runs.sort((a, b) => this.sign * compare(value(a), value(b)));
    }
    const order = JSON.stringify(runs.map((run) => run.label));
    if (order !== this.order) {
      this.order = order;
      this.body.append(...runs.map((run) => this.rows.get(run.label)?.row ?? ""));
    }
    let shown = 0;
    for (const { row, run } of this.rows.values()) {
      const text = `${run.label} ${run.method} ${methodTitle(state, run.method)} ${run.task} ${run.status} ${run.variant}`;
      row.hidden = !words.every((word) => text.toLowerCase().includes(word));
      shown += row.hidden ? 0 : 1;
    }
    say(this.found, words.length ? `${shown} of ${runs.length}` : `${runs.length}`);
  }
}

/** Compare two values of a column; missing ones come last. */
function compare(a: number | string | null, b: number | string | null): number {
  if (a === null || b === null) return a === b ? 0 : a === null ? 1 : -1;
  if (typeof a === "number" && typeof b === "number") return a - b;
  return String(a).localeCompare(String(b), "en", { numeric: true });
}
