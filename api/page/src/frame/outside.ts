// Points and triangles of a file that a person is about to use, for a look at it. What counts is what the service finds in it.
import { PLYLoader } from "three/examples/jsm/loaders/PLYLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
import type { BufferGeometry } from "three";
import { readFrame } from "./load";
import type { Frame } from "./reader";

/** Bytes above which a file is not shown. */
const MOST_BYTES = 200e6;

/** The shape in a file; null where it has none that can be shown. */
export async function readShape(file: File): Promise<Frame | null> {
    if (file.size > MOST_BYTES) return null;
    const bytes = await file.arrayBuffer();
    const start = new TextDecoder("latin1").decode(bytes.slice(0, 512));
    if (start.startsWith("\x89HDF")) return readFrame(bytes).catch(() => null);
    if (/^ply\r?\n/.test(start)) return fromGeometry(new PLYLoader().parse(bytes), false);
    if (/\.stl$/i.test(file.name)) return fromGeometry(new STLLoader().parse(bytes), true);
    // Bytes that are no text: a checkpoint, an image.
    if (start.includes("\0")) return null;
    return fromText(new TextDecoder().decode(bytes));
}

function frame(positions: Float32Array, triangles: Uint32Array): Frame | null {
    return positions.length > 0 ? { time: null, positions, fields: [], triangles, stride: 1 } : null;
}

/** STL has three corners of its own for each triangle. */
function fromGeometry(geometry: BufferGeometry, isSoup: boolean): Frame | null {
    const positions = Float32Array.from(geometry.getAttribute("position")?.array ?? []);
    const index = geometry.getIndex();
    const corners = index ? Uint32Array.from(index.array) : isSoup ? Uint32Array.from({ length: positions.length / 3 }, (_, k) => k) : new Uint32Array();
    return frame(positions, corners);
}

/** Lines of two or three numbers are points, as are those of OBJ and OFF, which also have faces. */
function fromText(text: string): Frame | null {
    const positions: number[] = [];
    const triangles: number[] = [];
    const isOff = /^\s*OFF\b/.test(text);
    const addFace = (corners: number[]) => {
        for (let k = 1; k + 1 < corners.length; k += 1) triangles.push(corners[0] as number, corners[k] as number, corners[k + 1] as number);
    };
    let isCounted = false;
    for (const line of text.split("\n")) {
        const words = line.trim().split(/[\s,;]+/);
        if (words[0] === "f") {
            const count = positions.length / 3;
            addFace(words.slice(1).map((word) => Number.parseInt(word, 10)).map((corner) => (corner < 0 ? count + corner : corner - 1)));
            continue;
        }
        const numbers = (words[0] === "v" ? words.slice(1) : words).map(Number);
        if (words[0] === "" || numbers.length < 2 || numbers.some(Number.isNaN)) continue;
        if (isOff && !isCounted) {
            isCounted = true;
        } else if (isOff && numbers[0] === numbers.length - 1) {
            addFace(numbers.slice(1));
        } else {
            positions.push(numbers[0] as number, numbers[1] as number, numbers[2] ?? 0);
        }
    }
    const count = positions.length / 3;
    return frame(Float32Array.from(positions), Uint32Array.from(triangles.every((corner) => corner < count) ? triangles : []));
}
