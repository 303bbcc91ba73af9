// Errors over spacing or over cost: a line for each method, in logarithms.
import { number } from "../format";
import { Plot, type Curve } from "./plot";

export interface Line {
    label: string;
    order?: number | null;
    points: { spacing?: number | null; error?: number | null; cpu_s?: number | null; value?: number | null; job?: string | null }[];
}

export function ErrorPlot({ lines, over, name }: { lines: Line[]; over: "spacing" | "cpu_s"; name: string }) {
    const points = lines.flatMap((line, which) => line.points.map((point) => ({ which, x: point[over] ?? Number.NaN, y: point.error ?? point.value ?? Number.NaN }))).filter(({ x, y }) => x > 0 && y > 0);
    points.sort((a, b) => a.x - b.x);
    const curves: Curve[] = lines.map((line, which) => ({
        label: `${line.label || name}${line.order ? ` (order ${number(line.order)})` : ""}`,
        values: points.map((point) => (point.which === which ? point.y : null)),
        isMarked: true,
    }));
    if (points.length === 0) return <p class="empty">No error yet.</p>;
    return <Plot x={points.map((point) => point.x)} xLabel={over === "spacing" ? "spacing" : "CPU seconds"} curves={curves} logX logY label={`error of ${name} over ${over}`} />;
}
