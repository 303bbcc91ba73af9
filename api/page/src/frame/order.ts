// The order in which points are drawn.

const BINS = 1024;

/** Every `stride`-th point, from front to back along a direction, roughly: what lies behind others is then not painted at all. A
 *  sort by counting; the number of points. */
export function frontToBack(positions: Float32Array, direction: [number, number, number], stride: number, order: Uint32Array): number {
    const [x, y, z] = direction;
    const count = Math.ceil(positions.length / 3 / stride);
    const depths = new Float32Array(count);
    let low = Infinity;
    let high = -Infinity;
    for (let k = 0; k < count; k += 1) {
        const at = 3 * stride * k;
        const depth = x * (positions[at] as number) + y * (positions[at + 1] as number) + z * (positions[at + 2] as number);
        depths[k] = depth;
        if (depth < low) low = depth;
        if (depth > high) high = depth;
    }
    const factor = high > low ? (BINS - 1) / (high - low) : 0;
    const binOf = (k: number) => {
        const bin = ((depths[k] as number) - low) * factor;
        // A point without a place comes last.
        return bin >= 0 ? bin | 0 : BINS - 1;
    };
    const starts = new Uint32Array(BINS + 1);
    for (let k = 0; k < count; k += 1) starts[binOf(k) + 1] = (starts[binOf(k) + 1] as number) + 1;
    for (let bin = 0; bin < BINS; bin += 1) starts[bin + 1] = (starts[bin + 1] as number) + (starts[bin] as number);
    for (let k = 0; k < count; k += 1) {
        const bin = binOf(k);
        const at = starts[bin] as number;
        order[at] = stride * k;
        starts[bin] = at + 1;
    }    return count;
}
