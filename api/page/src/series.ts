// A series as the service writes it: comma-separated values with a head.

export interface Series {
    names: string[];
    columns: Record<string, (number | null)[]>;
    rows: number;
}

export function readSeries(text: string): Series {
    const lines = text.trim().split(/\r?\n/);
    const names = (lines.shift() ?? "").split(",").filter(Boolean);
    const columns: Record<string, (number | null)[]> = Object.fromEntries(names.map((name) => [name, []]));
    for (const line of lines) {
        const cells = line.split(",");
        names.forEach((name, index) => {
            const cell = cells[index] ?? "";
            const value = Number(cell);
            columns[name]?.push(cell === "" || Number.isNaN(value) ? null : value);
        });
    }
    return { names, columns, rows: lines.length };
}
