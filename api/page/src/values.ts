// What a person writes into a field, as a value of a body.

/** A number as people write it (.05, 5., +2, 1e-3); null where it is none, or too large for one. */
export function readNumber(text: string): number | null {
    const trimmed = text.trim();
    if (!/^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$/.test(trimmed)) return null;
    const value = Number(trimmed);
    return Number.isFinite(value) ? value : null;
}

/** A number, JSON, or else the text itself, such as a formula. */
export function readValue(text: string): unknown {
    const number = readNumber(text);
    if (number !== null) return number;
    try {
        return JSON.parse(text) as unknown;
    } catch {
        return text.trim();
    }
}

/** Values between commas; commas within brackets, braces and quotes belong to a value. */
export function readValues(text: string): unknown[] {
    const parts: string[] = [];
    let depth = 0;
    let isQuoted = false;
    let part = "";
    for (const [k, letter] of [...text].entries()) {
        if (letter === '"' && text[k - 1] !== "\\") isQuoted = !isQuoted;
        if (!isQuoted && "[{".includes(letter)) depth += 1;
        if (!isQuoted && "]}".includes(letter)) depth -= 1;
        if (letter === "," && depth === 0 && !isQuoted) {
            parts.push(part);
            part = "";
        } else {
            part += letter;
        }
    }
    return [...parts, part].map((value) => value.trim()).filter(Boolean).map(readValue);
}

export function isRecord(value: unknown): value is Record<string, unknown> {
    return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** A copy with a value at a place; undefined takes it away. */
export function withValue(of: unknown, pointer: string[], value: unknown): unknown {
    const [key, ...rest] = pointer;
    if (key === undefined) return value;
    if (Array.isArray(of)) return of.map((item: unknown, index) => (String(index) === key ? withValue(item, rest, value) : item));
    // A choice may be written as its word alone.
    const copy: Record<string, unknown> = typeof of === "string" ? { type: of } : { ...(of as Record<string, unknown> | undefined) };
    const inner = withValue(copy[key], rest, value);
    if (inner === undefined) delete copy[key];
    else copy[key] = inner;
    return copy;
}
