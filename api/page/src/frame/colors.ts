// Color maps whose steps look equal: two for values, one for values about zero.

const MAPS: Record<string, string> = {
    viridis: "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
    cividis: "00224e 123570 3b496c 575d6d 707173 8a8678 a59c74 c3b369 e1cc55 fee838",
    diverging: "3b4cc0 6788ee 9abbff c9d7f0 dddddd f7cbb5 f7a889 e26952 b40426",
};

export const MAP_NAMES = Object.keys(MAPS);

type Color = [number, number, number];

function anchors(map: string): Color[] {
    return (MAPS[map] ?? MAPS.viridis ?? "").split(" ").map((hex) => [0, 2, 4].map((at) => Number.parseInt(hex.slice(at, at + 2), 16)) as Color);
}

/** A map as so many colors of four bytes. */
export function table(map: string, count = 256): Uint8Array {
    const colors = anchors(map);
    const bytes = new Uint8Array(4 * count);
    for (let k = 0; k < count; k += 1) {
        const at = (k / (count - 1)) * (colors.length - 1);
        const low = Math.min(Math.floor(at), colors.length - 2);
        const [a, b] = [colors[low] as Color, colors[low + 1] as Color];
        for (let c = 0; c < 3; c += 1) bytes[4 * k + c] = Math.round((a[c] as number) + (at - low) * ((b[c] as number) - (a[c] as number)));
        bytes[4 * k + 3] = 255;
    }
    return bytes;
}

export function gradient(map: string): string {
    return `linear-gradient(to right, ${anchors(map).map((color) => `rgb(${color.join(" ")})`).join(", ")})`;
}
