//! Circles of files: files each of which uses, directly or through others, all others.

use crate::imports::Crate;
use std::collections::{BTreeMap, BTreeSet};

type Edges = BTreeMap<String, BTreeSet<String>>;

/// Every circle of a crate as the sorted list of its files. A module root and its own children are no circle.
pub fn circles(of: &Crate) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    collect(of, &of.edges(), &mut found);
    found.sort();
    found
}

fn collect(of: &Crate, edges: &Edges, found: &mut Vec<Vec<String>>) {
    for component in components(edges) {
        if component.len() < 2 {
            continue;
        }
        let shortest = component.iter().min_by_key(|path| of.module(path).len()).unwrap();
        let root = of.module(shortest);
        if !component.iter().all(|path| of.module(path).starts_with(root)) {
            found.push(component.into_iter().collect());
            continue;
        }
        // Children may use the root above them: what remains without those edges is a circle among the children.
        let mut inner: Edges = Edges::new();
        for path in &component {
            let kept = edges[path].iter().filter(|target| component.contains(*target) && *target != shortest);
            inner.insert(path.clone(), kept.cloned().collect());
        }
        collect(of, &inner, found);
    }
}

/// Strongly connected components: sets of files that reach each other.
fn components(edges: &Edges) -> Vec<BTreeSet<String>> {
    let reached: BTreeMap<&String, BTreeSet<&String>> = edges.keys().map(|from| (from, reach(edges, from))).collect();
    let mut left: BTreeSet<&String> = edges.keys().collect();
    let mut found = Vec::new();
    while let Some(first) = left.first().copied() {
        let component: BTreeSet<&String> = left
            .iter()
            .copied()
            .filter(|other| *other == first || reached[first].contains(other) && reached[*other].contains(first))
            .collect();
        left.retain(|path| !component.contains(path));
        found.push(component.into_iter().cloned().collect());
    }
    found
}

fn reach<'a>(edges: &'a Edges, from: &'a String) -> BTreeSet<&'a String> {
    let mut reached = BTreeSet::new();
    let mut open = vec![from];
    while let Some(path) = open.pop() {
        for target in edges.get(path).into_iter().flatten() {
            if reached.insert(target) {
                open.push(target);
            }
        }
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::circles;
    use crate::imports::Crate;

    fn found(sources: &[(&str, &str)]) -> Vec<Vec<String>> {
        let sources: Vec<(String, String)> =
            sources.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect();
        circles(&Crate::new("x", &sources))
    }

    #[test]
    fn a_root_and_its_children_are_no_circle_but_two_children_are() {
        let root = ("x/a.rs", "mod b; mod c; use b::B; struct A; fn f() { c::g() }");
        assert!(found(&[root, ("x/a/b.rs", "use super::A;"), ("x/a/c.rs", "use super::b::B;")]).is_empty());
        let two = found(&[root, ("x/a/b.rs", "use super::A; use super::c::C;"), ("x/a/c.rs", "use super::b::B;")]);
        assert_eq!(two, [["x/a/b.rs", "x/a/c.rs"]]);
    }

    #[test]
    fn a_circle_through_a_child_of_another_module_is_found() {
        let files = [
            ("x/a.rs", "mod b; use crate::d::D; struct A;"),
            ("x/a/b.rs", "use super::A; pub struct B;"),
            ("x/d.rs", "use crate::a::b::B;"),
        ];
        assert_eq!(found(&files), [["x/a.rs", "x/a/b.rs", "x/d.rs"]]);
    }
}
