// Numbers, times and states as text.

/** Return a number as `conevo.numbers` writes it: four significant digits, "1,234", "4e-05"; "–" for none. */
export function number(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (Math.abs(value) >= 1000 && Math.abs(value) < 1e7) return count(value);
  const rounded = Number(value.toPrecision(4));
  if (rounded === 0 || (Math.abs(rounded) >= 1e-4 && Math.abs(rounded) < 1e7)) return String(rounded);
  return rounded.toExponential().replace(/(?<=e[+-])(?=\d$)/, "0"); // exponents have two digits
}

/** Return a whole number with separated thousands. */
export function count(value: number): string {
  return Math.round(value).toLocaleString("en");
}

/** Return a time span: "42 s", "4 min 05 s", "3 h 20 min", "2 d 3 h". */
export function duration(seconds: number): string {
  const whole = Math.round(seconds);
  const two = (value: number): string => String(Math.floor(value)).padStart(2, "0");
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${two(whole % 60)} s`;
  if (whole < 86400) return `${Math.floor(whole / 3600)} h ${two((whole % 3600) / 60)} min`;
  return `${Math.floor(whole / 86400)} d ${Math.floor((whole % 86400) / 3600)} h`;
}

/** Return the time left until a moment (seconds since 1970), "" if it is not known. */
export function left(endsAt: number | null): string {
  if (endsAt === null) return "";
  const seconds = endsAt - Date.now() / 1000;
  return seconds < 1 ? "any moment now" : `${duration(seconds)} left`;
}

/** Return a time of day, with the date if it is not today. */
export function clock(at: number): string {
  const moment = new Date(at * 1000);
  const time = moment.toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" });
  if (moment.toDateString() === new Date().toDateString()) return time;
  return `${moment.toLocaleDateString("en-GB", { day: "numeric", month: "short" })}, ${time}`;
}

export const STATES = ["finished", "running", "pending", "interrupted", "failed", "damaged"];

/** Return the number of runs in each state: "12 finished, 2 running, 76 pending". */
export function counts(found: Record<string, number>): string {
  const parts = STATES.filter((state) => found[state]).map((state) => `${found[state]} ${state}`);
  return parts.join(", ") || "no runs yet";
}
