// Data of a view: loaded, loaded again while it matters, and kept on the screen while the service is away.
import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { Unreachable } from "./api";

/** While the service is away it is asked again so often. */
export const AGAIN_MS = 2000;

export interface Loaded<T> {
    data: T | null;
    error: Error | null;
    reload: () => void;
}

/** Loads at once, again when a key changes, and every so many milliseconds while the page is seen; 0 for never. */
export function useLoaded<T>(load: (signal: AbortSignal) => Promise<T>, keys: unknown[], everyMs = 0): Loaded<T> {
    const [data, setData] = useState<T | null>(null);
    const [error, setError] = useState<Error | null>(null);
    const latest = useRef(load);
    latest.current = load;
    const starter = useRef(() => {});
    const reload = useCallback(() => starter.current(), []);
    useEffect(() => {
        setData(null);
        const abort = new AbortController();
        let isLoading = false;
        let isWanted = false;
        let later: number | undefined;
        // A load that is under way comes to its end: else frequent changes would let none of them do so.
        const start = async () => {
            isWanted = true;
            if (isLoading) return;
            isLoading = true;
            while (isWanted && !abort.signal.aborted) {
                isWanted = false;
                try {
                    const found = await latest.current(abort.signal);
                    if (abort.signal.aborted) return;
                    setData(found);
                    setError(null);
                } catch (failed) {
                    if (abort.signal.aborted) return;
                    setError(failed instanceof Error ? failed : new Error(String(failed)));
                    if (failed instanceof Unreachable) later = window.setTimeout(() => void start(), AGAIN_MS);
                }
            }
            isLoading = false;
        };
        starter.current = () => void start();
        void start();
        return () => {
            abort.abort();
            window.clearTimeout(later);
        };
    }, keys);
    useEffect(() => {
        if (everyMs <= 0) return;
        const timer = window.setInterval(() => document.hidden || reload(), everyMs);
        const onVisibility = () => document.hidden || reload();
        document.addEventListener("visibilitychange", onVisibility);
        return () => {
            window.clearInterval(timer);
            document.removeEventListener("visibilitychange", onVisibility);
        };
    }, [...keys, everyMs]);
    return { data, error, reload };
}

/** Loads again when something changes; the first time each has loaded by itself. */
export function useReload(reloads: (() => void)[], changes: unknown[]): void {
    const isFirst = useRef(true);
    useEffect(() => {
        if (isFirst.current) isFirst.current = false;
        else reloads.forEach((reload) => reload());
    }, changes);
}
