// Reads a VTKHDF frame in a worker of the browser: positions, fields and triangles, as plain arrays.
import h5wasm, { type Dataset, type Group } from "h5wasm";

export interface Field {
    name: string;
    components: number;
    values: Float32Array;
}

export interface Frame {
    time: number | null;
    positions: Float32Array;
    fields: Field[];
    /** Corners of triangles; empty where the frame has points alone. */
    triangles: Uint32Array;
    /** One of so many points is shown. */
    stride: number;
}

/** Size above which a frame is thinned out, and the points that are kept of it. */
const LARGE_BYTES = 50e6;
const MOST_POINTS = 250_000;

type Numbers = ArrayLike<number | bigint>;

function numbers(group: Group, path: string): Numbers | null {
    const found = group.get(path);
    return found && "value" in found ? ((found as Dataset).value as Numbers) : null;
}

/** Every `stride`-th of rows of so many numbers, with two-dimensional rows as the file has them. */
function thin(values: Numbers, components: number, stride: number): Float32Array {
    const count = Math.ceil(values.length / components / stride);
    const thinned = new Float32Array(count * components);
    for (let row = 0; row < count; row += 1) {
        for (let k = 0; k < components; k += 1) thinned[row * components + k] = Number(values[row * stride * components + k]);
    }
    return thinned;
}

/** Polygons as triangles about their first corners. */
function triangulate(root: Group): Uint32Array {
    const offsets = numbers(root, "VTKHDF/Polygons/Offsets");
    const corners = numbers(root, "VTKHDF/Polygons/Connectivity");
    if (!offsets || !corners) return new Uint32Array();
    const triangles: number[] = [];
    for (let polygon = 0; polygon + 1 < offsets.length; polygon += 1) {
        const [first, end] = [Number(offsets[polygon]), Number(offsets[polygon + 1])];
        for (let k = first + 1; k + 1 < end; k += 1) triangles.push(Number(corners[first]), Number(corners[k]), Number(corners[k + 1]));
    }
    return Uint32Array.from(triangles);
}

async function read(bytes: ArrayBuffer): Promise<Frame> {
    const { FS } = await h5wasm.ready;
    const name = "frame.h5";
    FS.writeFile(name, new Uint8Array(bytes));
    const file = new h5wasm.File(name, "r");
    try {
        const points = numbers(file, "VTKHDF/Points");
        if (!points) throw new Error("the file has no points of VTKHDF");
        const count = points.length / 3;
        const stride = bytes.byteLength > LARGE_BYTES ? Math.max(1, Math.ceil(count / MOST_POINTS)) : 1;
        const data = file.get("VTKHDF/PointData") as Group | null;
        const fields = (data?.keys() ?? []).flatMap((key): Field[] => {
            const values = data ? numbers(data, key) : null;
            if (!values || values.length === 0 || values.length % count !== 0) return [];
            const components = values.length / count;
            return [{ name: key, components, values: thin(values, components, stride) }];
        });
        const time = numbers(file, "VTKHDF/FieldData/Time")?.[0];
        return {
            time: time === undefined ? null : Number(time),
            positions: thin(points, 3, stride),
            fields,
            triangles: stride === 1 ? triangulate(file) : new Uint32Array(),
            stride,
        };
    } finally {
        file.close();
        FS.unlink(name);
    }
}

self.onmessage = async (message: MessageEvent<{ id: number; bytes: ArrayBuffer }>) => {
    const { id, bytes } = message.data;
    try {
        const frame = await read(bytes);
        const buffers = [frame.positions.buffer, frame.triangles.buffer, ...frame.fields.map((field) => field.values.buffer)];
        self.postMessage({ id, frame }, { transfer: buffers as ArrayBuffer[] });
    } catch (error) {
        self.postMessage({ id, error: error instanceof Error ? error.message : String(error) });
    }
};
