//! Which file of a crate uses an item of which other file.

use crate::code::{Token, block_end, is_test_file, tokens};
use std::collections::{BTreeMap, BTreeSet};

/// A path of modules and names, such as `["crate", "store", "Store"]`.
type Path = Vec<String>;

/// A file of a crate.
struct File {
    /// From the root of the workspace.
    path: String,
    /// Module path below the crate's root.
    module: Path,
    /// Names that `use` brings into the module, and what they stand for.
    names: BTreeMap<String, Path>,
    /// Paths that are mentioned: imported, or written out in the code.
    mentioned: BTreeSet<Path>,
}

/// The files of one crate and what they mention.
pub struct Crate {
    files: Vec<File>,
    by_module: BTreeMap<Path, usize>,
}

impl Crate {
    /// Reads the files of a crate: paths from the root of the workspace, all below `folder`, with their texts.
    pub fn new(folder: &str, sources: &[(String, String)]) -> Self {
        let mut files = Vec::new();
        for (path, _) in sources {
            let Some(inside) = path.strip_prefix(&format!("{folder}/")) else { continue };
            // A binary is a crate of its own.
            if is_test_file(inside) || inside == "main.rs" {
                continue;
            }
            let module = match inside.trim_end_matches(".rs") {
                "lib" => Vec::new(),
                name => name.split('/').map(str::to_owned).collect(),
            };
            files.push(File { path: path.clone(), module, names: BTreeMap::new(), mentioned: BTreeSet::new() });
        }
        let by_module: BTreeMap<Path, usize> =
            files.iter().enumerate().map(|(k, file)| (file.module.clone(), k)).collect();
        for file in &mut files {
            let text = &sources.iter().find(|(path, _)| *path == file.path).unwrap().1;
            read(file, &tokens(text), &by_module);
        }
        Self { files, by_module }
    }

    /// Edges from a file to the files whose items it uses, by their paths.
    pub fn edges(&self) -> BTreeMap<String, BTreeSet<String>> {
        let target = |file: &File| -> BTreeSet<String> {
            let mentioned = file.mentioned.iter().filter_map(|path| self.resolve(&file.module, path, 0));
            mentioned.map(|k| self.files[k].path.clone()).filter(|path| *path != file.path).collect()
        };
        self.files.iter().map(|file| (file.path.clone(), target(file))).collect()
    }

    /// The module of a file, by the file's path.
    pub fn module(&self, path: &str) -> &[String] {
        self.files.iter().find(|file| file.path == path).map_or(&[], |file| &file.module)
    }

    /// The file that defines what a path names in a module; a name that a module re-exports is followed to its origin.
    fn resolve(&self, module: &[String], path: &[String], depth: usize) -> Option<usize> {
        let mut place = module.to_vec();
        for (k, name) in path.iter().enumerate() {
            match name.as_str() {
                "crate" => place.clear(),
                "super" => {
                    place.pop();
                }
                "self" => {}
                name => {
                    place.push(name.to_owned());
                    if self.by_module.contains_key(&place) {
                        continue;
                    }
                    place.pop();
                    let here = *self.by_module.get(&place)?;
                    let Some(origin) = self.files[here].names.get(name) else {
                        // The first name of a path that is neither a module nor imported is another crate's.
                        return (k > 0).then_some(here);
                    };
                    let stands_for_itself = origin.len() == 1 && origin[0] == name;
                    if stands_for_itself || depth > 8 {
                        return None;
                    }
                    let rest: Path = origin.iter().chain(&path[k + 1..]).cloned().collect();
                    return self.resolve(&place, &rest, depth + 1);
                }
            }
        }
        self.by_module.get(&place).copied()
    }
}

/// Reads imports, and the paths that the code writes out.
fn read(file: &mut File, tokens: &[Token], by_module: &BTreeMap<Path, usize>) {
    let mut re_exported: Vec<(String, Path)> = Vec::new();
    let mut code: Vec<Path> = Vec::new();
    let mut k = 0;
    while k < tokens.len() {
        let text = |k: usize| tokens.get(k).map_or("", |token: &Token| token.text.as_str());
        if text(k) == "use" && text(k + 1) != "<" {
            let is_public = k > 0 && (text(k - 1) == "pub" || text(k - 1) == ")");
            let end = (k..tokens.len()).find(|k| text(*k) == ";").unwrap_or(tokens.len());
            let mut leaves = Vec::new();
            tree(&tokens[k + 1..end], &[], &mut leaves);
            for (name, path) in leaves {
                let is_own = path.first().is_some_and(|first| {
                    let mut child = file.module.clone();
                    child.push(if first == "self" { path[1].clone() } else { first.clone() });
                    by_module.contains_key(&child)
                });
                if is_public && is_own {
                    re_exported.push((name.clone(), path.clone()));
                } else if !is_module(&file.module, &path, by_module) {
                    file.mentioned.insert(path.clone());
                }
                file.names.insert(name, path);
            }
            k = end + 1;
        } else if tokens[k].is_word() && (k == 0 || text(k - 1) != "::" && text(k - 1) != ".") {
            let mut path = vec![text(k).to_owned()];
            while text(k + 1) == "::" && tokens.get(k + 2).is_some_and(Token::is_word) {
                path.push(text(k + 2).to_owned());
                k += 2;
            }
            code.push(path);
            k += 1;
        } else {
            k += 1;
        }
    }
    // What a root re-exports of its children is no use of its own, unless its code has the name.
    let heads: BTreeSet<&String> = code.iter().map(|path| &path[0]).collect();
    file.mentioned.extend(re_exported.iter().filter(|(name, _)| heads.contains(name)).map(|(_, path)| path.clone()));
    file.mentioned.extend(code.into_iter().filter(|path| path.len() > 1));
}

/// Whether an import names a module as a whole: what is used of it stands in the code.
fn is_module(module: &[String], path: &[String], by_module: &BTreeMap<Path, usize>) -> bool {
    let mut place = module.to_vec();
    for name in path {
        match name.as_str() {
            "crate" => place.clear(),
            "super" => {
                place.pop();
            }
            "self" => {}
            name => place.push(name.to_owned()),
        }
    }
    by_module.contains_key(&place)
}

/// The names that a tree of imports binds, each with its path.
fn tree(tokens: &[Token], before: &[String], leaves: &mut Vec<(String, Path)>) {
    let mut path = before.to_vec();
    let mut k = 0;
    while k < tokens.len() {
        match tokens[k].text.as_str() {
            "::" => {}
            "{" => {
                let end = block_end(tokens, k);
                let (mut depth, mut start) = (0_usize, k + 1);
                for place in k + 1..=end {
                    match tokens[place].text.as_str() {
                        "{" => depth += 1,
                        "}" if place < end => depth -= 1,
                        "," if depth == 0 => {
                            tree(&tokens[start..place], &path, leaves);
                            start = place + 1;
                        }
                        _ => {}
                    }
                }
                tree(&tokens[start..end], &path, leaves);
                return;
            }
            "as" => {
                leaves.push((tokens[k + 1].text.clone(), path));
                return;
            }
            "self" if !path.is_empty() => {}
            name => path.push(name.to_owned()),
        }
        k += 1;
    }
    if let Some(name) = path.last().filter(|_| path.len() > before.len() || !tokens.is_empty()) {
        leaves.push((name.clone(), path.clone()));
    }
}

#[cfg(test)]
mod tests {
    use super::Crate;

    #[test]
    fn names_are_followed_to_the_files_that_define_them() {
        let sources = [
            ("x/lib.rs", "pub mod a; pub mod b;"),
            ("x/a.rs", "mod c; mod d; pub use c::{C, Other as Same}; pub use d::D; pub struct A; fn f(d: D) {}"),
            ("x/a/c.rs", "use super::{A, D}; pub struct C; pub struct Other;"),
            ("x/a/d.rs", "use crate::b; use serde::x; pub struct D; fn f() { b::g(serde::y::z) }"),
            ("x/b.rs", "use crate::a::Same; fn g() { crate::a::C::new() }"),
        ]
        .map(|(path, text)| (path.to_owned(), text.to_owned()));
        let edges = Crate::new("x", &sources).edges();
        let of = |path: &str| edges[path].iter().map(String::as_str).collect::<Vec<_>>();
        assert!(of("x/lib.rs").is_empty());
        assert_eq!(of("x/a.rs"), ["x/a/d.rs"]);
        assert_eq!(of("x/a/c.rs"), ["x/a.rs", "x/a/d.rs"]);
        assert_eq!(of("x/a/d.rs"), ["x/b.rs"]);
        assert_eq!(of("x/b.rs"), ["x/a/c.rs"]);
    }
}
