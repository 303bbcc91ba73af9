// Curves over time: zoom by dragging, double click for the whole, values under the pointer.
import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import { number } from "../format";

export interface Curve {
    label: string;
    values: (number | null)[];
    /** Whether each value is marked. */
    isMarked?: boolean;
}

export interface PlotProps {
    x: number[];
    xLabel: string;
    curves: Curve[];
    logX?: boolean;
    logY?: boolean;
    height?: number;
    label: string;
}

/** Colors that are told apart also by those who see fewer (Okabe and Ito), for light and for dark ground. */
const COLORS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a7a00", "#888888"];

const LEAST_WIDTH = 240;

export function color(index: number): string {
    return COLORS[index % COLORS.length] ?? "#888888";
}

/** On a logarithmic axis only positive numbers have a place. */
function positive(values: (number | null)[], isLog: boolean): (number | null)[] {
    return isLog ? values.map((value) => (value !== null && value > 0 ? value : null)) : values;
}

const isShort = (x: ArrayLike<number | null | undefined>): boolean => (x[x.length - 1] ?? 1) < 10 * (x[0] ?? 0);

export function Plot({ x, xLabel, curves, logX = false, logY = false, height = 260, label }: PlotProps) {
    const place = useRef<HTMLDivElement>(null);
    const plot = useRef<uPlot | null>(null);
    const shape = `${curves.map((curve) => curve.label).join("|")}|${logX}|${logY}|${xLabel}`;
    // On a logarithmic axis a row at 0, such as that of the start, has no place.
    const rows = x.map((_, row) => row).filter((row) => !logX || (x[row] as number) > 0);
    const data = [rows.map((row) => x[row] as number), ...curves.map((curve) => positive(rows.map((row) => curve.values[row] ?? null), logY))] as uPlot.AlignedData;
    const shown = JSON.stringify(data);

    useEffect(() => {
        const at = place.current;
        if (!at) return;
        const style = getComputedStyle(at);
        const ink = style.getPropertyValue("--ink").trim() || "#444";
        const line = style.getPropertyValue("--line").trim() || "#ddd";
        const axis = { stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line }, values: (_: uPlot, ticks: (number | null)[]) => ticks.map((tick) => (tick === null ? "" : number(tick))) };
        const made = new uPlot(
            {
                width: Math.max(at.clientWidth, LEAST_WIDTH),
                height,
                scales: { x: { time: false, distr: logX ? 3 : 1 }, y: { distr: logY ? 3 : 1 } },
                axes: [
                    // Over less than a decade those at 1, 2 and 5 have numbers, not the powers of ten alone.
                    { ...axis, label: xLabel, labelSize: 20, ...(logX && isShort(data[0]) ? { filter: (_: uPlot, ticks: number[]) => ticks.map((tick) => (/^[125]/.test(tick.toExponential(0)) ? tick : null)) } : {}) },
                    { ...axis, size: 70 },
                ],
                legend: { live: true },
                cursor: { drag: { x: true, y: false } },
                series: [
                    { label: xLabel, value: (_, value) => number(value) },
                    ...curves.map((curve, index) => ({
                        label: curve.label,
                        stroke: color(index),
                        width: 1.75,
                        spanGaps: true,
                        points: curve.isMarked ? { show: true, size: 8 } : { size: 5 },
                        value: (_: uPlot, value: number | null) => number(value),
                    })),
                ],
            },
            data,
            at,
        );
        plot.current = made;
        const watch = new ResizeObserver(() => made.setSize({ width: Math.max(at.clientWidth, LEAST_WIDTH), height }));
        watch.observe(at);
        return () => {
            watch.disconnect();
            made.destroy();
            plot.current = null;
        };
    }, [shape, height]);

    useEffect(() => {
        const at = plot.current;
        if (!at) return;
        // A part that was chosen by dragging stays, while further rows come.
        const [first, last] = [at.data[0][0], at.data[0].at(-1)];
        const { min, max } = at.scales.x ?? {};
        const isZoomed = min != null && max != null && first !== undefined && last !== undefined && (min > first || max < last);
        at.setData(data, !isZoomed);
        if (isZoomed) at.setScale("x", { min, max });
    }, [shown]);

    return <div class="plot" ref={place} role="img" aria-label={label} />;
}
