//! The labels of branches for the pictures, from `branches.tsv`.
//!
//! **Input** the run folder. **Output** labels with names and colours, those of most branches first; none where the tree
//! stage has carried none to the branches, or where the tree is not the folder's own.

use std::collections::BTreeMap;

use espalier_model::Tree;
use espalier_model::label_table::rgb_from_hex;
use espalier_render::{LabelEntry, Labels};
use espalier_report::Rows;

use crate::error::Error;
use crate::page;
use crate::steps::Step;

/// The labels of a tree's branches.
pub(crate) fn labels(step: &Step<'_>, tree: &Tree) -> Result<Option<Labels>, Error> {
    if !page::is_of_folder(step.artifacts) {
        return Ok(None);
    }
    let rows = step.folder.text_if_there("branches.tsv")?.map(|text| Rows::parse(&text));
    let n_branches = tree.branches().list().len();
    Ok(rows.filter(|rows| rows.len() == n_branches).and_then(|rows| of_rows(&rows)))
}

fn of_rows(rows: &Rows) -> Option<Labels> {
    let label = |row: usize| rows.text(row, "label").parse::<i64>().ok();
    // By label: how many branches it has, and the first of them.
    let mut found: BTreeMap<i64, (usize, usize)> = BTreeMap::new();
    for row in 0..rows.len() {
        if let Some(label) = label(row) {
            found.entry(label).or_insert((0, row)).0 += 1;
        }
    }
    let mut order: Vec<(i64, usize, usize)> =
        found.into_iter().map(|(label, (n, row))| (label, n, row)).collect();
    order.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let entry = |&(_, _, row): &(i64, usize, usize)| LabelEntry {
        name: rows.text(row, "label_name").to_owned(),
        color: rgb_from_hex(rows.text(row, "label_color")),
    };
    let place: BTreeMap<i64, usize> = order.iter().enumerate().map(|(i, (label, ..))| (*label, i)).collect();
    let of_branch = (0..rows.len()).map(|row| place.get(&label(row)?).copied()).collect();
    (!order.is_empty()).then(|| Labels { entries: order.iter().map(entry).collect(), of_branch })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_most_branches_come_first() {
        let text = "branch\tlabel\tlabel_name\tlabel_color\n0\tn/a\tn/a\tn/a\n1\t2\tlower\t#0102ff\n2\t-1\tupper\tn/a\n\
                    3\t2\tlower\t#0102ff\n4\t10\tmiddle\tred\n";
        let labels = of_rows(&Rows::parse(text)).expect("labels");
        let entries: Vec<_> = labels.entries.iter().map(|entry| (entry.name.as_str(), entry.color)).collect();
        assert_eq!(entries, [("lower", Some([1, 2, 255])), ("upper", None), ("middle", None)]);
        assert_eq!(labels.of_branch, [None, Some(0), Some(1), Some(0), Some(2)]);
        assert_eq!(of_rows(&Rows::parse("branch\tlabel\n0\tn/a\n")), None);
    }
}
