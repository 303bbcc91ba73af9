// The spacing of points, from the points.

/** The usual gap between neighbors: the median over some points, found in a grid of cells. */
export function usualGap(positions: Float32Array, estimate: number): number {
    const count = positions.length / 3;
    const cell = Math.max(estimate * 2, 1e-12);
    const cells = new Map<string, number[]>();
    const keyOf = (k: number, shift: [number, number, number]) => [0, 1, 2].map((c) => Math.floor((positions[3 * k + c] as number) / cell) + (shift[c] as number)).join();
    const limit = Math.min(count, 20_000);
    for (let k = 0; k < limit; k += 1) {
        const key = keyOf(k, [0, 0, 0]);
        const held = cells.get(key);
        if (held) held.push(k);
        else cells.set(key, [k]);
    }
    const gaps: number[] = [];
    for (let k = 0; k < limit; k += Math.max(1, Math.floor(limit / 300))) {
        let least = Infinity;
        for (let dx = -1; dx <= 1; dx += 1) for (let dy = -1; dy <= 1; dy += 1) for (let dz = -1; dz <= 1; dz += 1) {
            for (const other of cells.get(keyOf(k, [dx, dy, dz])) ?? []) {
                if (other === k) continue;
                let square = 0;
                for (let c = 0; c < 3; c += 1) square += ((positions[3 * k + c] as number) - (positions[3 * other + c] as number)) ** 2;
                least = Math.min(least, square);
            }
        }
        if (Number.isFinite(least)) gaps.push(Math.sqrt(least));
    }
    gaps.sort((a, b) => a - b);
    return gaps[Math.floor(gaps.length / 2)] ?? estimate;
}
