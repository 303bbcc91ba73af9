// The frames of a job: a picture, a slider over time, and what it shows.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { get, Unreachable, type FileEntry, type SceneKind } from "../api";
import { number } from "../format";
import { AGAIN_MS, useLoaded } from "../load";
import { Trouble } from "../parts/basics";
import { readNumber } from "../values";
import { gradient, MAP_NAMES } from "./colors";
import { choices, describe, fieldOf, firstChoice, range, valuesOf, vectorsOf } from "./fields";
import { loadFrame } from "./load";
import type { Frame } from "./reader";
import type { FrameScene } from "./scene";

export interface FrameViewProps {
    job: string;
    kind: string;
    frames: FileEntry[];
    isRunning: boolean;
    /** Told of the scene, to link its camera with others. */
    onScene?: (scene: FrameScene | null) => void;
}

const PLAY_MS = 120;
/** A pointer that has moved no farther has not been dragged. */
const STILL_PX = 4;

export function FrameView({ job, kind, frames, isRunning, onScene }: FrameViewProps) {
    // Without a choice the newest frame is shown, also when further ones come.
    const [chosen, setChosen] = useState<number | null>(null);
    const [isPlaying, setPlaying] = useState(false);
    const [frame, setFrame] = useState<Frame | null>(null);
    const [error, setError] = useState<Error | null>(null);
    const [tries, setTries] = useState(0);
    const [choice, setChoice] = useState<string | null>(null);
    const [map, setMap] = useState<string | null>(null);
    const [given, setGiven] = useState<[string, string]>(["", ""]);
    const [hasSurface, setHasSurface] = useState(true);
    const [hasGlyphs, setHasGlyphs] = useState(false);
    const [clip, setClip] = useState<{ axis: 0 | 1 | 2; share: number }>({ axis: 0, share: 1 });
    const [picked, setPicked] = useState<number | null>(null);
    const canvas = useRef<HTMLCanvasElement>(null);
    const pressed = useRef<[number, number]>([0, 0]);
    const scene = useRef<FrameScene | null>(null);
    const [isReady, setReady] = useState(false);

    const { data: described } = useLoaded(async (signal) => (kind ? get<SceneKind>(`v1/scenes/${kind}`, signal) : null), [kind]);

    const last = frames.length - 1;
    const index = Math.min(chosen ?? last, last);
    const file = frames[index];

    useEffect(() => {
        if (!file) return;
        let isOver = false;
        let later: number | undefined;
        loadFrame(job, file.path, file.sha256).then(
            (found) => {
                if (isOver) return;
                setFrame(found);
                setError(null);
            },
            (failed: unknown) => {
                if (isOver) return;
                setError(failed instanceof Error ? failed : new Error(String(failed)));
                if (failed instanceof Unreachable) later = window.setTimeout(() => setTries(tries + 1), AGAIN_MS);
            },
        );
        return () => {
            isOver = true;
            window.clearTimeout(later);
        };
    }, [job, file?.path, file?.sha256, tries]);

    useEffect(() => {
        const at = canvas.current;
        if (!at) return;
        let isOver = false;
        void import("./scene").then(({ FrameScene }) => {
            if (isOver) return;
            try {
                scene.current = new FrameScene(at);
                onScene?.(scene.current);
                // For measurements: how long a picture takes.
                Object.assign(at, { drawNow: (isMoving: boolean) => scene.current?.drawNow(isMoving) });
                setReady(true);
            } catch (failed) {
                setError(failed instanceof Error ? failed : new Error(String(failed)));
            }
        });
        return () => {
            isOver = true;
            onScene?.(null);
            scene.current?.dispose();
            scene.current = null;
            setReady(false);
        };
    }, [job]);

    const name = frame ? choice ?? firstChoice(frame, kind) : "";
    const values = useMemo(() => (frame ? valuesOf(frame, name) : null), [frame, name]);
    const [least, most] = useMemo(() => (values ? range(values) : [0, 1]), [values]);
    const usedMap = map ?? (least < 0 && most > 0 ? "diverging" : "viridis");
    // A map about zero is symmetric.
    const ends: [number, number] = usedMap === "diverging" && least < 0 && most > 0 ? [-Math.max(-least, most), Math.max(-least, most)] : [least, most];
    const [low, high] = ends.map((end, k) => readNumber(given[k] ?? "") ?? end) as [number, number];

    useEffect(() => {
        if (!frame || !scene.current) return;
        const normals = vectorsOf(frame, "normal") ?? vectorsOf(frame, "normals");
        const isBand = kind === "vortex" || kind === "redistance" || kind === "droplet";
        const surface = hasSurface && isBand ? vectorsOf(frame, "closest_point") : null;
        scene.current.show(frame, { values, low, high, map: usedMap, surface, normals: isBand && !hasGlyphs ? null : normals, hasGlyphs, clip });
    }, [frame, values, low, high, usedMap, hasSurface, hasGlyphs, clip, isReady, kind]);

    useEffect(() => {
        if (!isPlaying) return;
        const timer = window.setInterval(() => setChosen((now) => ((now ?? last) + 1) % (last + 1)), PLAY_MS);
        return () => window.clearInterval(timer);
    }, [isPlaying, last]);

    const pick = (event: MouseEvent) => {
        // The end of a drag picks nothing.
        if (Math.hypot(event.clientX - pressed.current[0], event.clientY - pressed.current[1]) > STILL_PX) return;
        const box = canvas.current?.getBoundingClientRect();
        if (!box || !scene.current) return;
        const found = scene.current.pick(event.clientX - box.left, event.clientY - box.top);
        setPicked(found < 0 ? null : found);
    };
    const save = async () => {
        const picture = await scene.current?.picture();
        if (!picture) return;
        const link = document.createElement("a");
        link.href = URL.createObjectURL(picture);
        link.download = `${job}-${file?.path.replace(/\D/g, "") ?? "frame"}.png`;
        link.click();
        URL.revokeObjectURL(link.href);
    };
    const unit = described?.fields.find((field) => field.name === fieldOf(name))?.unit;
    const hasNormals = frame !== null && (vectorsOf(frame, "normal") ?? vectorsOf(frame, "normals")) !== null;
    return (
        <div class="frame">
            <div class="canvas">
                <canvas ref={canvas} tabIndex={0} onPointerDown={(event) => { pressed.current = [event.clientX, event.clientY]; }} onClick={pick} onKeyDown={(event) => { if (scene.current?.press(event.key)) event.preventDefault(); }} title="drag or arrow keys to turn or move, + and − to zoom, 0 for the whole" aria-label={`frame at time ${number(frame?.time)}, colored by ${name}`} data-frame={file?.path} data-ready={frame ? "yes" : "no"} />
                {!frame && !error && <p class="quiet over">reading the frame</p>}
            </div>
            <Trouble error={error} />
            <div class="legend" aria-label="legend">
                <span class="figure">{number(low)}</span>
                <span class="scale" style={{ background: gradient(usedMap) }} />
                <span class="figure">{number(high)}</span>
                <span>{name}{unit ? `, ${unit}` : ""}</span>
            </div>
            <div class="time">
                <button type="button" onClick={() => setPlaying(!isPlaying)} disabled={frames.length < 2} aria-label={isPlaying ? "stop" : "play"}>{isPlaying ? "❚❚" : "▶"}</button>
                <input type="range" min={0} max={last} value={index} onInput={(event) => setChosen(Number(event.currentTarget.value))} aria-label="frame" />
                <span class="figure">time {number(file?.time)}</span>
                {chosen !== null && isRunning && <button type="button" onClick={() => setChosen(null)}>follow</button>}
            </div>
            <div class="choices">
                <label>color by{" "}
                    <select value={name} onChange={(event) => { setChoice(event.currentTarget.value); setGiven(["", ""]); }}>
                        {(frame ? choices(frame) : []).map((option) => <option key={option} value={option}>{option}</option>)}
                    </select>
                </label>
                <label>map{" "}
                    <select value={usedMap} onChange={(event) => setMap(event.currentTarget.value)}>
                        {MAP_NAMES.map((option) => <option key={option} value={option}>{option}</option>)}
                    </select>
                </label>
                <label>from <input class="short" inputMode="decimal" value={given[0]} placeholder={number(low)} onInput={(event) => setGiven([event.currentTarget.value, given[1]])} /></label>
                <label>to <input class="short" inputMode="decimal" value={given[1]} placeholder={number(high)} onInput={(event) => setGiven([given[0], event.currentTarget.value])} /></label>
                {frame && vectorsOf(frame, "closest_point") && <label><input type="checkbox" checked={hasSurface} onChange={() => setHasSurface(!hasSurface)} /> zero level</label>}
                {hasNormals && <label><input type="checkbox" checked={hasGlyphs} onChange={() => setHasGlyphs(!hasGlyphs)} /> normals</label>}
                <label>cut{" "}
                    <select value={clip.axis} onChange={(event) => setClip({ ...clip, axis: Number(event.currentTarget.value) as 0 | 1 | 2 })}>{["x", "y", "z"].map((axis, k) => <option key={axis} value={k}>{axis}</option>)}</select>
                    <input type="range" min={0} max={1} step={0.01} value={clip.share} onInput={(event) => setClip({ ...clip, share: Number(event.currentTarget.value) })} aria-label="cut" />
                </label>
                <button type="button" onClick={() => scene.current?.whole()}>whole view</button>
                <button type="button" onClick={save}>save as PNG</button>
            </div>
            {frame && frame.stride > 1 && <p class="quiet">One of {frame.stride} points is shown; the file has them all.</p>}
            {frame && picked !== null && 3 * picked < frame.positions.length && (
                <dl class="picked" aria-label="picked point">
                    {describe(frame, picked).map(([field, numbers]) => <><dt>{field}</dt><dd class={fieldOf(name) === field ? "shown" : ""}>{numbers.map(number).join(", ")}</dd></>)}
                </dl>
            )}
        </div>
    );
}
