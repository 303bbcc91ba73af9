// Small parts that every view uses.
import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { Refusal, Unreachable, type Finding, type Job } from "../api";
import { number } from "../format";

/** Shapes beside the words: a state is not told by its color alone. */
const SHAPES: Record<string, string> = {
    queued: "○", running: "▶", pausing: "◫", paused: "❚❚", canceling: "◌", interrupted: "↯", succeeded: "✓", failed: "✕", canceled: "–",
    open: "▶", ended: "✓",
};

export function State({ state, reason }: { state: string; reason?: string | null }) {
    return (
        <span class={`state ${state}`}>
            <span aria-hidden="true">{SHAPES[state] ?? "•"}</span> {state}
            {reason && <span class="reason"> {reason}</span>}
        </span>
    );
}

export function Health({ status, why }: { status?: string | null; why?: string | null }) {
    if (!status) return <span class="quiet">–</span>;
    return (
        <span class={`health ${status}`}>
            <span aria-hidden="true">{status === "sound" ? "●" : "▲"}</span> {status}
            {why && <span class="reason"> {why}</span>}
        </span>
    );
}

export function Bar({ fraction, label }: { fraction: number; label?: string }) {
    const percent = Math.round(1000 * fraction) / 10;
    return (
        <span class="bar" role="progressbar" aria-valuenow={percent} aria-valuemin={0} aria-valuemax={100} aria-label={label ?? "progress"}>
            <span style={{ width: `${percent}%` }} />
            <b>{percent.toFixed(percent < 100 ? 1 : 0)} %</b>
        </span>
    );
}

/** What went wrong, in the service's own words. */
export function Trouble({ error }: { error: Error | null }) {
    if (!error) return null;
    if (error instanceof Unreachable) {
        return <p class="trouble" role="status">The service cannot be reached; this page tries again by itself.</p>;
    }
    const problem = error instanceof Refusal ? error.problem : null;
    return (
        <div class="trouble" role="alert">
            <strong>{problem?.title ?? "Something went wrong"}</strong>
            <p>{problem?.detail ?? error.message}</p>
            {problem?.errors && problem.errors.length > 0 && (
                <ul>
                    {problem.errors.map((item) => (
                        <li key={item.pointer + item.code}>
                            <code>{item.pointer || "/"}</code> {item.detail}
                            {item.did_you_mean && <> Did you mean <code>{item.did_you_mean}</code>?</>}
                        </li>
                    ))}
                </ul>
            )}
        </div>
    );
}

export function Findings({ findings }: { findings: Finding[] }) {
    if (findings.length === 0) return null;
    return (
        <ul class="findings">
            {findings.map((finding) => (
                <li key={`${finding.code}-${finding.step}`} class={finding.severity}>
                    <span aria-hidden="true">{finding.severity === "warning" ? "▲" : "•"}</span>{" "}
                    <code>{finding.code}</code> {finding.message}
                    {finding.time !== null && finding.time !== undefined && <span class="quiet"> (at time {number(finding.time)})</span>}
                    {finding.advice && <p class="advice">{finding.advice}</p>}
                </li>
            ))}
        </ul>
    );
}

/** A button that says what happened to its work. */
export function Act({ children, work, kind, title, isOff }: { children: ComponentChildren; work: () => Promise<unknown>; kind?: string; title?: string; isOff?: boolean }) {
    const [busy, setBusy] = useState(false);
    const [error, setError] = useState<Error | null>(null);
    const onClick = async () => {
        setBusy(true);
        setError(null);
        try {
            await work();
        } catch (failed) {
            setError(failed instanceof Error ? failed : new Error(String(failed)));
        } finally {
            setBusy(false);
        }
    };
    return (
        <>
            <button type="button" class={kind} disabled={busy || isOff} onClick={onClick} title={title}>{children}</button>
            {error && <Trouble error={error} />}
        </>
    );
}

export function Copy({ text, children }: { text: string; children: ComponentChildren }) {
    const [copied, setCopied] = useState(false);
    // Browsers lend the clipboard to secure pages alone; elsewhere the text is shown, to be copied by hand.
    const [isShown, setShown] = useState(false);
    const copy = async () => {
        try {
            await navigator.clipboard.writeText(text);
        } catch {
            setShown(!isShown);
            return;
        }
        setCopied(true);
        window.setTimeout(() => setCopied(false), 1500);
    };
    return (
        <>
            <button type="button" onClick={copy}>{copied ? "copied" : children}</button>
            {isShown && <textarea class="copy" readOnly rows={6} value={text} ref={(place) => place?.select()} aria-label="text to copy" />}
        </>
    );
}

/** What a person may do with a job in its state. */
export function actionsOf(job: Job): string[] {
    switch (job.state) {
        case "queued":
        case "running":
            return ["pause", "cancel"];
        case "paused":
            return ["resume", "cancel"];
        case "pausing":
            return ["cancel"];
        case "failed":
        case "canceled":
            return ["retry"];
        default:
            return [];
    }
}
