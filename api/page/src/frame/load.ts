// Frames by their paths: read once, the last few kept. The reader of HDF5 is loaded when the first frame is wanted.
import { request } from "../api";
import type { Frame } from "./reader";

const KEPT = 8;

let worker: Worker | null = null;
let count = 0;
const waiting = new Map<number, { resolve: (frame: Frame) => void; reject: (error: Error) => void }>();
const kept = new Map<string, Promise<Frame>>();

function reader(): Worker {
    if (worker) return worker;
    worker = new Worker("frame-reader.js", { type: "module" });
    worker.onmessage = (message: MessageEvent<{ id: number; frame?: Frame; error?: string }>) => {
        const { id, frame, error } = message.data;
        const held = waiting.get(id);
        waiting.delete(id);
        if (frame) held?.resolve(frame);
        else held?.reject(new Error(error ?? "the frame cannot be read"));
    };
    worker.onerror = (event) => {
        for (const held of waiting.values()) held.reject(new Error(event.message || "the reader of frames failed"));
        waiting.clear();
    };
    return worker;
}

/** Reads the bytes of a VTKHDF file; they are gone afterwards. */
export function readFrame(bytes: ArrayBuffer): Promise<Frame> {
    count += 1;
    const id = count;
    return new Promise((resolve, reject) => {
        waiting.set(id, { resolve, reject });
        reader().postMessage({ id, bytes }, [bytes]);
    });
}

async function read(path: string): Promise<Frame> {
    return readFrame(await (await request(path, { accept: "*/*" })).arrayBuffer());
}

/** A frame of a job. A file that was written again under its name has another digest and is read anew. */
export function loadFrame(job: string, path: string, sha256: string): Promise<Frame> {
    const key = `${job}/${path}/${sha256}`;
    const held = kept.get(key);
    if (held) {
        kept.delete(key);
        kept.set(key, held);
        return held;
    }
    const frame = read(`v1/jobs/${job}/files/${path}`);
    kept.set(key, frame);
    frame.catch(() => kept.delete(key));
    const [oldest] = kept.keys();
    if (kept.size > KEPT && oldest) kept.delete(oldest);
    return frame;
}
