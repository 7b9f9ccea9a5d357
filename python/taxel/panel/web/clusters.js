// Marks in a row of the lanes: those that would cover each other are collapsed into their count.

/** How wide a stretch is that one count stands for, CSS pixels: counts beside each other show where there are more. */
const WIDEST = 72;

/**
 * Marks in groups: each that covers the one before it is in its group.
 * @template {{ x: number }} T
 * @param {T[]} marks in ascending order of x, CSS pixels
 * @param {number} wide of a mark, CSS pixels
 * @param {number} stacked of so many at most each is shown by itself, though they overlap
 * @returns {{ single: T[], counts: { from: number, to: number, marks: T[] }[] }} those that are shown, and those that are counted, from which
 *   x to which
 */
export function collapsed(marks, wide, stacked) {
  /** @type {T[]} */
  const single = [];
  /** @type {{ from: number, to: number, marks: T[] }[]} */
  const counts = [];
  let begin = 0;
  const close = (/** @type {number} */ end) => {
    const group = marks.slice(begin, end);
    begin = end;
    if (group.length <= stacked) {
      single.push(...group);
      return;
    }
    for (let first = 0; first < group.length; ) {
      let last = first;
      while (last + 1 < group.length && group[last + 1].x - group[first].x <= WIDEST) last++;
      counts.push({ from: group[first].x, to: group[last].x, marks: group.slice(first, last + 1) });
      first = last + 1;
    }
  };
  marks.forEach(({ x }, i) => {
    if (i > 0 && x - marks[i - 1].x >= wide) close(i);
  });
  close(marks.length);
  return { single, counts };
}
