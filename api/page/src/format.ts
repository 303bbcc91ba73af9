// Numbers and times for people.

const DIGITS = 4;

/** A number with four digits, in powers of ten where it is far from one. */
export function number(value: number | null | undefined): string {
    if (value === null || value === undefined || Number.isNaN(value)) return "–";
    if (value === 0) return "0";
    const size = Math.abs(value);
    if (Number.isInteger(value) && size < 1e7) return value.toLocaleString("en");
    if (size >= 1e5 || size < 1e-3) {
        const [digits, power] = value.toExponential(DIGITS - 1).split("e");
        return `${Number(digits)}e${Number(power)}`;
    }
    return String(Number(value.toPrecision(DIGITS)));
}

/** A time span. */
export function seconds(value: number | null | undefined): string {
    if (value === null || value === undefined) return "–";
    if (value < 1) return `${number(1000 * value)} ms`;
    if (value < 60) return `${number(value)} s`;
    const whole = Math.round(value);
    const parts: [number, string][] = [[Math.floor(whole / 86400), "d"], [Math.floor(whole / 3600) % 24, "h"], [Math.floor(whole / 60) % 60, "min"], [whole % 60, "s"]];
    const first = parts.findIndex(([count]) => count > 0);
    return parts.slice(first, first + 2).map(([count, unit]) => `${count} ${unit}`).join(" ");
}

export function bytes(value: number | null | undefined): string {
    if (value === null || value === undefined) return "–";
    const units = ["B", "kB", "MB", "GB", "TB"];
    let size = value;
    let unit = 0;
    while (size >= 1000 && unit < units.length - 1) {
        size /= 1000;
        unit += 1;
    }
    return `${unit === 0 ? size : Number(size.toPrecision(3))} ${units[unit]}`;
}

/** How long ago a time was, for people; the exact time belongs into a title. */
export function ago(time: string | null | undefined, now = Date.now()): string {
    if (!time) return "–";
    const past = (now - Date.parse(time)) / 1000;
    return past < 5 ? "just now" : `${seconds(Math.max(0, Math.round(past))).replace(/ \d+ s$/, "")} ago`;
}

/** A body as a command that does the same. */
export function curl(path: string, body: unknown): string {
    const text = JSON.stringify(body, null, 2).replaceAll("'", "'\\''");
    return `curl -X POST ${new URL(path, document.baseURI).href} -H 'Content-Type: application/json' -d '${text}'`;
}
