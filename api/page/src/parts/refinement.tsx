// What a study that refines has found: its levels, their order, and how far the value is known.
import { useState } from "preact/hooks";
import { number, seconds } from "../format";
import { ErrorPlot, type Line } from "./error-plot";

interface Level {
    index: number;
    value: number;
    spacing: number;
    error_estimate?: number | null;
    cpu_s?: number | null;
    job?: string | null;
}

export interface RefinementReport {
    quantity: string;
    levels: Level[];
    order?: { value: number; low?: number | null; high?: number | null } | null;
    extrapolated?: number | null;
    gci?: number | null;
    convergence?: string | null;
    tolerance_met: boolean;
    next?: { value: number; cpu_s?: number | null } | null;
    alternatives?: { point: Record<string, unknown>; order?: number | null; predicted_cpu_s?: number | null; chosen: boolean; obstacle?: string | null }[];
}

function withInterval(order: RefinementReport["order"]): string {
    if (!order) return "–";
    const isKnown = typeof order.low === "number" && typeof order.high === "number";
    return `${number(order.value)}${isKnown ? ` (${number(order.low)} to ${number(order.high)})` : ""}`;
}

export function Refinement({ report, isOver }: { report: RefinementReport; isOver: boolean }) {
    const { levels, quantity, next, alternatives } = report;
    const [over, setOver] = useState<"spacing" | "cpu_s">("spacing");
    const line: Line = { label: quantity, order: report.order?.value, points: levels.map(({ spacing, cpu_s, error_estimate }) => ({ spacing, cpu_s, error: error_estimate })) };
    const facts: [string, string][] = [
        ["order, with its 95 % interval", withInterval(report.order)], ["extrapolated", number(report.extrapolated)],
        ["grid convergence index", number(report.gci)], ["convergence", report.convergence ?? "–"],
        ["tolerance", report.tolerance_met ? "met" : isOver ? "not met" : "not met yet"],
    ];
    if (next && !report.tolerance_met) facts.push(["next level", `${number(next.value)}, ${seconds(next.cpu_s)} of CPU time`]);
    return (
        <section>
            <h2>{quantity}</h2>
            <dl>{facts.map(([name, value]) => <><dt>{name}</dt><dd>{value}</dd></>)}</dl>
            <p class="choices"><label>error over <select value={over} onChange={(event) => setOver(event.currentTarget.value as "spacing" | "cpu_s")}><option value="spacing">spacing</option><option value="cpu_s">CPU seconds</option></select></label></p>
            <ErrorPlot lines={[line]} over={over} name={quantity} />
            <div class="scroll" tabIndex={0}>
                <table aria-label="levels">
                    <thead><tr><th scope="col">level</th><th scope="col">spacing</th><th scope="col">value</th><th scope="col">error</th><th scope="col">CPU</th><th scope="col">job</th></tr></thead>
                    <tbody>
                        {levels.map(({ index, spacing, value, error_estimate, cpu_s, job }) => (
                            <tr key={index}>
                                <td>{index}</td><td class="figure">{number(spacing)}</td><td class="figure">{number(value)}</td><td class="figure">{number(error_estimate)}</td>
                                <td class="figure">{seconds(cpu_s)}</td><td>{job && <a href={`#/jobs/${job}`}>{job.slice(-6)}</a>}</td>
                            </tr>
                        ))}
                    </tbody>
                </table>
            </div>
            {alternatives && alternatives.length > 0 && (
                <table>
                    <thead><tr><th scope="col">alternative</th><th scope="col">order</th><th scope="col">CPU up to the tolerance</th><th scope="col">chosen</th></tr></thead>
                    <tbody>
                        {alternatives.map((one, k) => (
                            <tr key={k}><td><code>{JSON.stringify(one.point)}</code></td><td class="figure">{number(one.order)}</td><td class="figure">{one.obstacle ?? seconds(one.predicted_cpu_s)}</td><td>{one.chosen ? "✓ yes" : "–"}</td></tr>
                        ))}
                    </tbody>
                </table>
            )}
        </section>
    );
}
