// Every vector of vectors.json as JavaScript sees it:  node vectors.mjs FILE
// Prints how many of each kind were tried, and what did not hold, as JSON.

import { deepStrictEqual } from "node:assert";
import { readFileSync } from "node:fs";
import { decode, encode } from "./msgpack.mjs";
import { judge } from "./requests.mjs";

const near = (found, expected, within) => {
  if (!(Math.abs(found - expected) <= within)) throw new Error(`${found} instead of ${expected}`);
};

const TRIALS = {
  message({ direction, json, hex }) {
    const bytes = Buffer.from(hex, "hex");
    deepStrictEqual(decode(bytes), json);
    deepStrictEqual(decode(encode(json)), json);
    if (direction === "request") deepStrictEqual(judge(bytes), null);
    if (direction === "request") deepStrictEqual(judge(encode(json)), null);
  },
  malformed({ hex, code, id }) {
    deepStrictEqual(judge(Buffer.from(hex, "hex")), { code, id });
  },
  reading(vector) {
    if (vector.gap !== undefined) {
      deepStrictEqual(vector.gap < 0.001, vector.touch);
      return;
    }
    const [x, y, z, w] = vector.orientation;
    const up = [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
    up.forEach((value, axis) => near(value, vector.up[axis], 1e-9));
    const asin = (value) => Math.asin(Math.min(1, Math.max(-1, value)));
    [asin(up[1]), asin(up[0])].forEach((value, axis) => near(value, vector.tilt[axis], 1e-7));
    const along = up[2] > 0 ? Math.max(vector.belly_height, 0) / up[2] : Infinity;
    near(Math.min(along, vector.upper), vector.clearance, 1e-9);
    deepStrictEqual(along >= vector.upper, vector.clearance_saturated);
  },
};

const tried = {};
const failed = [];
for (const vector of JSON.parse(readFileSync(process.argv[2], "utf8"))) {
  tried[vector.kind] = (tried[vector.kind] ?? 0) + 1;
  try {
    TRIALS[vector.kind](vector);
  } catch (error) {
    failed.push(`${vector.name}: ${error.message}`);
  }
}
console.log(JSON.stringify({ tried, failed }));
