// What SPEC.md, section 7, asks of a request: enough to say which error a wrong one gets.

import { Float, Malformed, decode } from "./msgpack.mjs";

const isInt = (least) => (value) => typeof value === "number" && value >= least;
const isName = (value) => typeof value === "string" && [...value].length >= 1 && [...value].length <= 64;
const isFloat = (value) => value instanceof Float || typeof value === "number";
const isVersions = (value) => Array.isArray(value) && value.length <= 64 && value.every(isInt(1));
const isTargets = (value) =>
  typeof value === "object" && !Array.isArray(value) && !(value instanceof Float) &&
  Object.keys(value).length <= 64 && Object.entries(value).every(([key, angle]) => isName(key) && isFloat(angle));

const COMMON = { id: isInt(0), client: isName };
const SESSION = { ...COMMON, session: isName };
const OPTIONAL = { hello: { software: isName }, stop: { session: isName } };
const REQUIRED = {
  hello: { ...COMMON, versions: isVersions },
  stop: COMMON,
  perform: { ...SESSION, targets: isTargets },
};
for (const type of ["heartbeat", "acquire", "release", "read", "hold", "relax", "clear"]) REQUIRED[type] = SESSION;

/** The error with which a robot answers a frame, or null where the frame is a valid request. */
export function judge(bytes) {
  let found;
  try {
    found = decode(bytes, { markFloats: true });
  } catch (error) {
    if (!(error instanceof Malformed)) throw error;
    return { code: error.code, id: error.id ?? null };
  }
  const id = isInt(0)(found.id) ? found.id : null;
  if (typeof found.type !== "string") return { code: "malformed", id };
  if (!Object.hasOwn(REQUIRED, found.type)) return { code: "unknown_type", id };
  for (const [name, fits] of Object.entries(REQUIRED[found.type])) {
    if (found[name] === undefined || found[name] === null || !fits(found[name])) return { code: "malformed", id };
  }
  for (const [name, fits] of Object.entries(OPTIONAL[found.type] ?? {})) {
    const absent = found[name] === undefined || found[name] === null;
    if (!absent && !fits(found[name])) return { code: "malformed", id };
  }
  return null;
}
