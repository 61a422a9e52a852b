//! What the runs of a group are called.
//!
//! **Input** paths as the user has typed them. **Output** a label for each, no two alike.
//! **Steps** 1. The parts of a relative path; of one that begins at the root or goes upwards only the last. 2. Leading parts
//! that all have in common are left out. 3. What is still alike is numbered.
//! **Guarantees** no part that the user has not typed, but names of run folders below a folder that was given.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path};

pub(super) fn of(paths: &[&Path]) -> Vec<String> {
    let parts: Vec<Vec<String>> = paths.iter().map(|path| parts(path)).collect();
    let shortest = parts.iter().map(Vec::len).min().unwrap_or(1);
    let is_common = |depth: &usize| parts.iter().all(|other| other[*depth] == parts[0][*depth]);
    let n_common = (0..shortest.saturating_sub(1)).take_while(is_common).count();
    let mut labels: Vec<String> = Vec::with_capacity(parts.len());
    let mut known = BTreeSet::new();
    // The number to go on with, by label: thousands may be alike.
    let mut next: BTreeMap<String, usize> = BTreeMap::new();
    for parts in &parts {
        let label = parts[n_common..].join("/");
        let number = next.entry(label.clone()).or_insert(1);
        let free = (*number..).map(|n| (n, if n == 1 { label.clone() } else { format!("{label} ({n})") }));
        if let Some((n, free)) = free.into_iter().find(|(_, label)| known.insert(label.clone())) {
            *number = n + 1;
            labels.push(free);
        }
    }
    labels
}

/// Numbers in place of labels.
pub(crate) fn numbered(n: usize) -> Vec<String> {
    let width = n.to_string().len();
    (1..=n).map(|i| format!("run-{i:0width$}")).collect()
}

/// The parts of a path that are shown; at least one.
fn parts(path: &Path) -> Vec<String> {
    let named = path.components().filter_map(|component| match component {
        Component::Normal(name) => Some(name.to_string_lossy().into_owned()),
        _ => None,
    });
    let is_plain = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    let named: Vec<String> = named.collect();
    match named.last() {
        None => vec!["run".to_owned()],
        Some(last) if !is_plain => vec![last.clone()],
        Some(_) => named,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_tell_runs_apart_and_no_more() {
        let of = |paths: &[&str]| of(&paths.iter().map(Path::new).collect::<Vec<_>>());
        assert_eq!(of(&["out/a", "./out/b/"]), ["a", "b"]);
        assert_eq!(of(&["out/a/run", "out/b/run"]), ["a/run", "b/run"]);
        assert_eq!(of(&["/home/jane/out/a", "/data/a", "../x/a"]), ["a", "a (2)", "a (3)"]);
        assert_eq!(of(&["out/only"]), ["only"]);
        assert_eq!(of(&["a", "a/b"]), ["a", "a/b"]);
        assert_eq!(of(&[".", "..", "/"]), ["run", "run (2)", "run (3)"]);
        assert_eq!(of(&[]), [] as [&str; 0]);
        assert_eq!(numbered(10)[..2], ["run-01", "run-02"]);
    }
}
