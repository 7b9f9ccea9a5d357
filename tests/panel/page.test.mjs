// What the page computes without a browser: run by test_page.py.

import assert from "node:assert/strict";
import test from "node:test";

import { Timeline } from "../../python/taxel/panel/web/timeline.js";

const range = (from, to) => Array.from({ length: to - from }, (_, k) => from + k);

test("curves of frames have gaps where none arrived", () => {
  // Columns of 4 ms and two rows: a frame every 10 columns, none in 200 to 400 and after 900.
  const timeline = new Timeline(2, 4000);
  const raster = new Uint8Array(2 * 1000);
  for (let column = 0; column <= 900; column += 10) if (column < 200 || column >= 400) raster[2 * column + 1] = 16;
  timeline.put({ restart: false, column_us: 4000, t_us: 4e6 - 1, following: true, first: 0, count: 1000, raster });
  const gaps = (us) => [...timeline.gaps(-5, 999, us)];
  const silent = [...range(191, 400), ...range(901, 1000)];
  assert.deepEqual(gaps(36000), silent);
  assert.equal(gaps(35999).length, 1000 - range(0, 91).filter((k) => k < 20 || k >= 40).length);
  assert.deepEqual(gaps(300000), silent);
  assert.deepEqual(gaps(1e6), []);
});
