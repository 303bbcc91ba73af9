// A look at a file of points or triangles before it is used.
import { useEffect, useRef, useState } from "preact/hooks";
import { number } from "../format";
import type { Frame } from "../frame/reader";
import type { FrameScene } from "../frame/scene";

export function Preview({ file }: { file: File }) {
    const canvas = useRef<HTMLCanvasElement>(null);
    const [shape, setShape] = useState<Frame | null>(null);
    useEffect(() => {
        let isOver = false;
        setShape(null);
        // What the service says of the file tells what is wrong with it.
        void import("../frame/outside").then(({ readShape }) => readShape(file)).then((found) => isOver || setShape(found), () => {});
        return () => {
            isOver = true;
        };
    }, [file]);
    useEffect(() => {
        const at = canvas.current;
        if (!shape || !at) return;
        let scene: FrameScene | null = null;
        let isOver = false;
        // Without graphics there is no picture, and the description stands.
        void import("../frame/scene").then(({ FrameScene }) => {
            if (isOver) return;
            scene = new FrameScene(at);
            scene.show(shape, { values: null, low: 0, high: 0, map: "viridis", surface: null, normals: null, hasGlyphs: false, clip: { axis: 0, share: 1 } });
        }).catch(() => {});
        return () => {
            isOver = true;
            scene?.dispose();
        };
    }, [shape]);
    if (!shape) return null;
    const points = number(shape.positions.length / 3);
    const triangles = shape.triangles.length / 3;
    return (
        <figure class="preview">
            <div class="canvas"><canvas ref={canvas} aria-label={`preview of ${file.name}`} /></div>
            <figcaption class="quiet">{file.name}: {points} points{triangles > 0 ? `, ${number(triangles)} triangles` : ""}</figcaption>
        </figure>
    );
}
