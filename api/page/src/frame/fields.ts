// What of a frame is shown: one number for each point, its range, and what a kind of scene begins with.
import type { Field, Frame } from "./reader";

/** Fields that a kind of scene is first colored by, the best first. */
const FIRST: Record<string, string[]> = {
    vortex: ["phi", "psi"],
    redistance: ["phi", "psi"],
    droplet: ["phase", "pressure", "phi"],
    surface_pde: ["value", "u", "concentration", "curvature", "mean_curvature"],
    front: ["curvature", "mean_curvature", "speed"],
};

/** Fields that are numbers of points, not quantities. */
const HIDDEN = new Set(["particle_id", "closest_point", "finding", "grid_point"]);

/** What can be chosen: a field, or one component or the length of a vector. */
export function choices(frame: Frame): string[] {
    return frame.fields.filter((field) => !HIDDEN.has(field.name)).flatMap((field) => {
        if (field.components === 1) return [field.name];
        return [`|${field.name}|`, ...["x", "y", "z"].slice(0, field.components).map((axis) => `${field.name}.${axis}`)];
    });
}

export function firstChoice(frame: Frame, kind: string): string {
    const all = choices(frame);
    return (FIRST[kind] ?? []).find((name) => all.includes(name)) ?? all.find((name) => !/normal/.test(name)) ?? all[0] ?? "";
}

/** Name of the field of a choice. */
export const fieldOf = (choice: string): string => choice.replace(/^\|(.*)\|$/, "$1").replace(/\.[xyz]$/, "");

function find(frame: Frame, name: string): Field | undefined {
    return frame.fields.find((field) => field.name === name);
}

/** A number for each point. */
export function valuesOf(frame: Frame, choice: string): Float32Array | null {
    const field = find(frame, fieldOf(choice));
    if (!field) return null;
    if (field.components === 1) return field.values;
    const count = field.values.length / field.components;
    const values = new Float32Array(count);
    const axis = "xyz".indexOf(choice.at(-1) ?? "");
    for (let k = 0; k < count; k += 1) {
        if (!choice.startsWith("|") && axis >= 0) {
            values[k] = field.values[field.components * k + axis] as number;
            continue;
        }
        let square = 0;
        for (let c = 0; c < field.components; c += 1) square += (field.values[field.components * k + c] as number) ** 2;
        values[k] = Math.sqrt(square);
    }
    return values;
}

export function vectorsOf(frame: Frame, name: string): Float32Array | null {
    const field = find(frame, name);
    return field && field.components === 3 ? field.values : null;
}

/** Relative differences below which numbers are one number but for rounding. */
const ONE_NUMBER = 1e-5;

/** Least and largest of the numbers that exist; around a number that all have there is room for rounding. */
export function range(values: Float32Array): [number, number] {
    let low = Infinity;
    let high = -Infinity;
    for (const value of values) {
        if (value < low) low = value;
        if (value > high) high = value;
    }
    if (low > high) return [0, 1];
    const least = ONE_NUMBER * Math.max(Math.abs(low), Math.abs(high));
    return high - low < least ? [low - 100 * least, high + 100 * least] : [low, high];
}

/** Everything that is known of a point. */
export function describe(frame: Frame, point: number): [string, number[]][] {
    const position: [string, number[]] = ["position", [...frame.positions.subarray(3 * point, 3 * point + 3)]];
    return [position, ...frame.fields.map((field): [string, number[]] => [field.name, [...field.values.subarray(field.components * point, field.components * (point + 1))]])];
}
