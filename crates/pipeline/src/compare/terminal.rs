//! The table of a comparison for a terminal: what is read most, aligned, the best of each column marked.
//!
//! **Input** the rows of the runs, the seconds of their methods. **Output** lines of text.
//! **Best** among the layouts without crossings of one tree and one set of targets, by the number as it is shown: what
//! reads alike is equally good. `*` marks it, `>` the layout that became the embedding.

use espalier_model::table::fixed;
use espalier_model::{Better, ComparedRun, ComparedRuns, MethodRow};

/// A column of numbers.
struct Shown {
    head: &'static str,
    better: Better,
    text: fn(&MethodRow) -> String,
}

const COLUMNS: [Shown; 13] = [
    Shown { head: "cross", better: Better::Neither, text: |row| row.crossings.to_string() },
    Shown { head: "overlap", better: Better::Less, text: |row| row.overlaps.to_string() },
    Shown { head: "energy", better: Better::Less, text: |row| short(row.energy.total()) },
    Shown {
        head: "length%",
        better: Better::Less,
        text: |row| fixed(100.0 * row.losses.length_loss_mean, 2),
    },
    Shown { head: "max%", better: Better::Less, text: |row| fixed(100.0 * row.losses.length_loss_max, 1) },
    Shown { head: "angle°", better: Better::Less, text: |row| fixed(row.losses.angle3d_error_mean_deg, 2) },
    Shown { head: "p95°", better: Better::Less, text: |row| fixed(row.losses.angle3d_error_p95_deg, 1) },
    Shown { head: "max°", better: Better::Less, text: |row| fixed(row.losses.angle3d_error_max_deg, 1) },
    Shown {
        head: "sibling°", better: Better::Less, text: |row| fixed(row.losses.sibling_error_mean_deg, 1)
    },
    Shown { head: "stress", better: Better::Less, text: |row| fixed(row.losses.stress, 3) },
    Shown { head: "rank", better: Better::More, text: |row| fixed(row.losses.spearman, 3) },
    Shown { head: "clear", better: Better::More, text: |row| fixed(row.losses.clearance_min_edges, 3) },
    Shown {
        head: "backw%",
        better: Better::Less,
        text: |row| fixed(100.0 * row.losses.backward_length_share, 1),
    },
];

const LEGEND: &str = "\
* best of the layouts without crossings of the same tree and targets   > the layout that became the map
length, angle: lost against space (mean, largest)   sibling: between the branches of a fork   stress, rank: of distances
clear: least distance of edges, in median edges   backw: length that points backward   every column: dictionary.tsv
";

/// The table; `seconds` has the methods of each run with their time.
pub(crate) fn table(runs: &ComparedRuns, seconds: &[&[(String, f64)]]) -> String {
    let has_names = runs.runs.len() > 1;
    let mut lines = vec![heads(has_names)];
    for (run, seconds) in runs.runs.iter().zip(seconds) {
        for (row_idx, row) in run.rows.iter().enumerate() {
            let chosen = if row_idx == run.chosen { "> " } else { "  " };
            let mut cells = if has_names { vec![run.name.clone()] } else { Vec::new() };
            cells.push(format!("{chosen}{}", row.method));
            cells.extend(COLUMNS.iter().map(|column| marked(runs, run, row, column)));
            let time = seconds.iter().find(|(method, _)| *method == row.method);
            cells.push(time.map_or_else(|| "n/a".to_owned(), |(_, seconds)| format!("{seconds:.2}")));
            lines.push(cells);
        }
    }
    aligned(&lines, if has_names { 2 } else { 1 }) + "\n" + LEGEND
}

/// The heads of the columns of numbers.
pub(crate) fn number_heads() -> Vec<String> {
    COLUMNS.iter().map(|column| column.head.to_owned()).collect()
}

/// The numbers of a row, without marks.
pub(crate) fn numbers(row: &MethodRow) -> Vec<String> {
    COLUMNS.iter().map(|column| (column.text)(row)).collect()
}

fn heads(has_names: bool) -> Vec<String> {
    let names = ["run", "  method"].into_iter().skip(usize::from(!has_names));
    // The heads end where the numbers do, before the mark.
    let columns = COLUMNS.iter().map(|column| format!("{} ", column.head));
    names.map(str::to_owned).chain(columns).chain(["seconds".to_owned()]).collect()
}

/// The number of a row, with a mark if it is the best of those it compares with.
fn marked(runs: &ComparedRuns, run: &ComparedRun, row: &MethodRow, column: &Shown) -> String {
    let text = (column.text)(row);
    let number = |text: &str| text.parse::<f64>().unwrap_or(f64::NAN);
    let own = number(&text);
    let is_rival = |other: &&ComparedRun| other.tree == run.tree && other.targets == run.targets;
    // A run may hold a layout that is scored against other targets than the embedding.
    let kind = run.rows.get(run.chosen).map(|chosen| chosen.targets);
    let compares = |row: &&MethodRow| row.crossings == 0 && Some(row.targets) == kind;
    let mut rivals = runs.runs.iter().filter(is_rival).flat_map(|run| &run.rows).filter(compares);
    let is_best = match column.better {
        Better::Neither => false,
        Better::Less => rivals.all(|rival| own <= number(&(column.text)(rival))),
        Better::More => rivals.all(|rival| own >= number(&(column.text)(rival))),
    };
    format!("{text}{}", if is_best && compares(&row) { '*' } else { ' ' })
}

/// Four significant digits; powers of ten where those would be long.
fn short(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e5).contains(&size) {
        return format!("{value:.1e}");
    }
    let decimals = if size >= 100.0 { 1 } else { 3 };
    fixed(value, decimals)
}

/// Columns of equal width: the first `n_left` to the left, the others to the right.
pub(crate) fn aligned(lines: &[Vec<String>], n_left: usize) -> String {
    let n_columns = lines.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        lines.iter().filter_map(|cells| cells.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..n_columns).map(width).collect();
    let mut text = String::new();
    for cells in lines {
        let padded = cells.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
            if column < n_left { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        text.push_str(padded.collect::<Vec<_>>().join(" ").trim_end());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use espalier_model::{Energy, Losses, TargetKind};

    use super::*;

    fn row(method: &str, crossings: usize, stress: f64) -> MethodRow {
        MethodRow {
            method: method.to_owned(),
            crossings,
            overlaps: 0,
            energy: Energy { angle: 1234.567, ..Energy::default() },
            losses: Losses { stress, ..Losses::default() },
            evaluations: 0,
            targets: TargetKind::Intrinsic,
        }
    }

    fn run(name: &str, tree: &str, rows: Vec<MethodRow>) -> ComparedRun {
        let (name, tree) = (name.to_owned(), tree.to_owned());
        ComparedRun { name, tree, targets: String::new(), seed: 0, chosen: 1, rows }
    }

    #[test]
    fn the_best_without_crossings_is_marked_among_its_like() {
        let runs = vec![
            run("a", "t", vec![row("projection", 3, 0.1), row("radial", 0, 0.4)]),
            run("b", "t", vec![row("cone", 0, 0.300_1), row("solver", 0, 0.299_9)]),
            run("c", "u", vec![row("cone", 0, 0.9), row("pso", 0, 0.95)]),
        ];
        let runs = ComparedRuns { runs };
        let seconds = [("radial".to_owned(), 1.5)];
        let text = table(&runs, &[&seconds, &[], &[]]);
        let lines: Vec<&str> = text.lines().collect();
        let line = |method: &str| lines.iter().find(|line| line.contains(method)).copied().expect("a line");
        assert!(line("projection").contains("0.100 ") && !line("projection").contains('*'), "{text}");
        assert!(line("> radial").contains("0.400 ") && line("> radial").ends_with("1.50"), "{text}");
        assert!(line("b     cone").contains("0.300*") && line("> solver").contains("0.300*"), "{text}");
        assert!(line("c     cone").contains("0.900*") && line("> pso").contains("0.950 "), "{text}");
        assert!(line("> pso").contains("1234.6*") && line("> pso").ends_with("n/a"), "{text}");
        // The numbers of a column end in one place, the mark aside.
        assert_eq!(line("> pso").find("1234.6"), line("> solver").find("1234.6"));
    }

    #[test]
    fn a_layout_for_other_targets_is_no_rival() {
        let other = MethodRow { targets: TargetKind::IntrinsicMirrored, ..row("pso", 0, 0.1) };
        let runs = vec![run("a", "t", vec![other, row("cone", 0, 0.3), row("radial", 0, 0.4)])];
        let runs = ComparedRuns { runs };
        let text = table(&runs, &[&[]]);
        let line = |method: &str| text.lines().find(|line| line.contains(method)).expect("a line").to_owned();
        assert!(line("pso").contains("0.100 ") && !line("pso").contains('*'), "{text}");
        assert!(line("cone").contains("0.300*") && line("radial").contains("0.400 "), "{text}");
    }

    #[test]
    fn numbers_are_short() {
        for (value, expected) in [
            (0.0, "0.000"),
            (0.12345, "0.123"),
            (137.4455, "137.4"),
            (1e-9, "1.0e-9"),
            (1_032_096.2, "1.0e6"),
        ] {
            assert_eq!(short(value), expected);
        }
    }
}
