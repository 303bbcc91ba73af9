// A form for a JSON Schema as the service writes them: groups, choices between kinds, numbers with ranges, and text for the rest.
import { useState } from "preact/hooks";
import type { Problem } from "../api";
import { isRecord, readNumber, readValue } from "../values";

export interface Schema {
    type?: string;
    const?: unknown;
    enum?: unknown[];
    anyOf?: Schema[];
    oneOf?: Schema[];
    properties?: Record<string, Schema>;
    items?: Schema;
    required?: string[];
    description?: string;
    default?: unknown;
    minimum?: number;
    maximum?: number;
    exclusiveMinimum?: number;
    exclusiveMaximum?: number;
}

type Item = NonNullable<Problem["errors"]>[number];

export interface ParameterProps {
    name: string;
    schema: Schema;
    value: unknown;
    pointer: string[];
    set: (pointer: string[], value: unknown) => void;
    errorsAt: (pointer: string) => Item[];
    isOpen?: boolean;
    /** An item of a list, which is there as long as nobody takes it out. */
    isItem?: boolean;
    /** The choice that this parameter lies in: a shape may consist of shapes. */
    around?: Map<string, Schema>;
}

/** The schema without "or null": leaving a field empty means the same. */
function unwrap(schema: Schema): Schema {
    const options = (schema.anyOf ?? schema.oneOf ?? []).filter((option) => option.type !== "null");
    if (options.length !== 1) return schema;
    const { anyOf: _, oneOf: __, ...rest } = schema;
    return { ...options[0], ...rest };
}

/** The kinds of an object that is one of several, by their `type`. */
function kindsOf(schema: Schema): Map<string, Schema> {
    const kinds = new Map<string, Schema>();
    for (const option of (schema.anyOf ?? schema.oneOf ?? []).map(unwrap)) {
        const word = option.properties?.type?.const;
        if (typeof word === "string" && !kinds.has(word)) kinds.set(word, option);
    }
    return kinds;
}

/** The kinds of a schema that names only their words, as the parts of a shape do, from the choice around it. */
function kindsAround(schema: Schema, around: Map<string, Schema> | undefined): Map<string, Schema> {
    const names = schema.properties?.type?.enum ?? [];
    return new Map([...(around ?? [])].filter(([word]) => names.includes(word)));
}

/** The kind of a value: its `type`, the word that it is, or the first kind that its fields suit. */
function kindOf(value: unknown, kinds: Map<string, Schema>): string {
    if (typeof value === "string") return value;
    if (!isRecord(value)) return "";
    const of = value;
    if (typeof of.type === "string") return of.type;
    const fits = ({ properties, required }: Schema) => Object.keys(of).every((key) => properties?.[key]) && (required ?? []).every((key) => key in of);
    return [...kinds].find(([, kind]) => fits(kind))?.[0] ?? "";
}

/** Whether the items of a list have fields of their own; a list of numbers, words or formulas is written as one text. */
function hasRecords(schema: Schema): boolean {
    if (!schema.items) return false;
    const item = unwrap(schema.items);
    return item.properties !== undefined || kindsOf(item).size > 0;
}

function words(schema: Schema): string[] | null {
    if (schema.enum?.every((word) => typeof word === "string")) return schema.enum as string[];
    const options = schema.anyOf ?? schema.oneOf ?? [];
    const found = options.flatMap((option) => (typeof option.const === "string" ? [option.const] : option.enum?.every((word) => typeof word === "string") ? (option.enum as string[]) : []));
    return options.length > 0 && found.length >= options.filter((option) => option.type !== "null").length ? found : null;
}

function rangeOf(schema: Schema): string {
    const low = schema.minimum !== undefined ? `≥ ${schema.minimum}` : schema.exclusiveMinimum !== undefined ? `> ${schema.exclusiveMinimum}` : "";
    const high = schema.maximum !== undefined ? `≤ ${schema.maximum}` : schema.exclusiveMaximum !== undefined ? `< ${schema.exclusiveMaximum}` : "";
    return [low, high].filter(Boolean).join(", ");
}

const show = (value: unknown): string => (value === undefined || value === null ? "" : typeof value === "string" ? value : JSON.stringify(value));

export function Parameter(props: ParameterProps) {
    const schema = unwrap(props.schema);
    const own = kindsOf(schema);
    const kinds = own.size > 0 ? own : kindsAround(schema, props.around);
    if (kinds.size > 0) return <Kinds {...props} schema={schema} kinds={kinds} around={own.size > 0 ? own : props.around} />;
    if (hasRecords(schema)) return <List {...props} schema={schema} />;
    if (schema.properties) return <Group {...props} schema={schema} />;
    return <Leaf {...props} schema={schema} />;
}

/** Shows further fields, and goes to the first of them: the button that was pressed is gone. */
function showMore(group: HTMLElement | null, show: () => void): void {
    const known = new Set(group?.querySelectorAll("input, select"));
    show();
    window.setTimeout(() => [...(group?.querySelectorAll<HTMLElement>("input, select") ?? [])].find((field) => !known.has(field))?.focus());
}

/** A list of records or choices, one below the other. */
function List({ name, schema, value, pointer, set, errorsAt, around }: ParameterProps) {
    const items = Array.isArray(value) ? (value as unknown[]) : [];
    const item = unwrap(schema.items ?? {});
    const [first] = [...kindsOf(item).keys(), ...kindsAround(item, around).keys()];
    const leave = (kept: unknown[]) => set(pointer, kept.length > 0 ? kept : undefined);
    return (
        <fieldset class="group">
            <legend title={schema.description}>{name}</legend>
            {schema.description && <p class="doc">{schema.description}</p>}
            <Errors items={errorsAt(`/${pointer.join("/")}`)} />
            {items.map((one, k) => (
                <div class="item" key={k}>
                    <Parameter name={`${name} ${k + 1}`} schema={item} value={one} pointer={[...pointer, String(k)]} set={set} errorsAt={errorsAt} around={around} isItem />
                    <button type="button" class="link" aria-label={`take out ${name} ${k + 1}`} onClick={() => leave(items.filter((_, other) => other !== k))}>take out</button>
                </div>
            ))}
            <button type="button" class="link" aria-label={`add to ${name}`} onClick={() => leave([...items, first ? { type: first } : {}])}>add</button>
        </fieldset>
    );
}

function Group({ name, schema, value, pointer, set, errorsAt, isOpen, around }: ParameterProps) {
    const of = isRecord(value) ? value : {};
    const entries = Object.entries(schema.properties ?? {}).filter(([, inner]) => inner.const === undefined);
    // What is given when the form opens comes first, then plain fields, then groups. Later nothing moves, so that no field slips away
    // from under the hand.
    const [first] = useState(() => new Set(entries.map(([key]) => key).filter((key) => key in of)));
    const isGroup = (inner: Schema) => inner.properties !== undefined || kindsOf(inner).size > 0 || hasRecords(inner);
    const rank = ([key, inner]: [string, Schema]) => (first.has(key) ? 0 : isGroup(unwrap(inner)) ? 2 : 1);
    const sorted = [...entries].sort((a, b) => rank(a) - rank(b));
    const [isMore, setMore] = useState(first.size === 0);
    const isGiven = (entry: [string, Schema]) => rank(entry) === 0 || entry[0] in of;
    const given = sorted.filter((entry) => isMore || isGiven(entry));
    const rest = sorted.filter((entry) => !isMore && !isGiven(entry));
    const fields = (list: [string, Schema][]) => list.map(([key, inner]) => <Parameter key={key} name={key} schema={inner} value={of[key]} pointer={[...pointer, key]} set={set} errorsAt={errorsAt} around={around} />);
    return (
        <fieldset class="group">
            <legend title={schema.description}>{name}</legend>
            {!isOpen && schema.description && <p class="doc">{schema.description}</p>}
            {!isOpen && pointer.length > 0 && <Errors items={errorsAt(`/${pointer.join("/")}`)} />}
            {fields(given)}
            {rest.length > 0 && <button type="button" class="link" onClick={(event) => showMore(event.currentTarget.parentElement, () => setMore(true))}>{rest.length} more</button>}
        </fieldset>
    );
}

function Kinds({ name, schema, value, pointer, set, errorsAt, kinds, around, isItem }: ParameterProps & { kinds: Map<string, Schema> }) {
    const word = kindOf(value, kinds);
    const of = typeof value === "string" ? { type: value } : value;
    const chosen = kinds.get(word);
    const id = `field${pointer.join("-")}`;
    return (
        <div class="kind">
            <div class="field">
                <label for={id}>{name}</label>
                <select id={id} value={word} onChange={(event) => set(pointer, event.currentTarget.value ? { type: event.currentTarget.value } : undefined)}>
                    {!(isItem && word) && <option value="">{show(schema.default) ? `default: ${show(schema.default).slice(0, 60)}` : "default"}</option>}
                    {[...kinds.keys()].map((option) => <option key={option} value={option}>{option}</option>)}
                </select>
                <p class="doc">{chosen?.description ?? schema.description}</p>
                <Errors items={errorsAt(`/${pointer.join("/")}`)} />
            </div>
            {chosen && Object.keys(chosen.properties ?? {}).length > 1 && <Group key={word} name={word} schema={{ ...chosen, description: undefined }} value={of} pointer={pointer} set={set} errorsAt={errorsAt} around={around} isOpen />}
        </div>
    );
}

function Errors({ items }: { items: Item[] }) {
    return <>{items.map((item) => <p key={item.code} class="wrong" role="alert">{item.detail}{item.did_you_mean ? ` Did you mean ${item.did_you_mean}?` : ""}</p>)}</>;
}

function Leaf({ name, schema, value, pointer, set, errorsAt }: ParameterProps) {
    const id = `field${pointer.join("-")}`;
    // What is being typed stays, whatever is drawn anew meanwhile.
    const [typed, setTyped] = useState<string | null>(null);
    const items = errorsAt(`/${pointer.join("/")}`);
    const options = words(schema);
    const common = { id, "aria-invalid": items.length > 0, "aria-describedby": `${id}-doc` };
    const isNumber = schema.type === "number" || schema.type === "integer";
    const read = (text: string): unknown => {
        if (text.trim() === "") return undefined;
        if (isNumber) return readNumber(text) ?? text;
        return schema.type === "string" && !/^[[{]/.test(text) ? text : readValue(text);
    };
    return (
        <div class="field">
            <label for={id}>{name}</label>
            {schema.type === "boolean" ? (
                <select {...common} value={show(value)} onChange={(event) => set(pointer, event.currentTarget.value === "" ? undefined : event.currentTarget.value === "true")}>
                    <option value="">{schema.default !== undefined ? `default: ${show(schema.default)}` : "default"}</option><option value="true">yes</option><option value="false">no</option>
                </select>
            ) : options ? (
                <select {...common} value={show(value)} onChange={(event) => set(pointer, event.currentTarget.value || undefined)}>
                    <option value="">{schema.default !== undefined ? `default: ${show(schema.default)}` : "default"}</option>
                    {options.map((option) => <option key={option} value={option}>{option}</option>)}
                </select>
            ) : (
                <input
                    {...common}
                    value={typed ?? show(value)}
                    placeholder={show(schema.default)}
                    inputMode={isNumber ? "decimal" : undefined}
                    onInput={(event) => setTyped(event.currentTarget.value)}
                    onChange={(event) => {
                        setTyped(null);
                        set(pointer, read(event.currentTarget.value));
                    }}
                />
            )}
            <p class="doc" id={`${id}-doc`}>{schema.description}{rangeOf(schema) && <span class="range"> {rangeOf(schema)}</span>}</p>
            <Errors items={items} />
        </div>
    );
}
