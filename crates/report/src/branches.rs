//! The table of branches, and narrow places.
//!
//! **Input** `branches.tsv`, `stenoses.tsv`. **Output** the columns that a reader asks for first, in one unit; the longest
//! branches where there are too many for a page.

use espalier_geom::math;
use espalier_model::anatomy::branch_measures;
use espalier_model::table::fixed;
use maud::{Markup, html};

use crate::facts::Facts;
use crate::length::{Unit, number};
use crate::page::{Head, absent, table};
use crate::params::Params;
use crate::rows::Rows;

/// Columns that are lengths are shown in the tree's unit.
const MM: &str = "_mm";
/// The columns on the page.
const COLUMNS: [&str; 13] = [
    "branch",
    "parent",
    "generation",
    "strahler",
    "tips",
    "length_mm",
    "tortuosity",
    "radius_mean_mm",
    "radius_min_mm",
    "taper_mm_per_mm",
    "branching_angle_deg",
    "radius_to_parent",
    "label_name",
];
/// Narrow places on the page.
const MAX_STENOSES: usize = 20;

pub(crate) fn body(facts: &Facts<'_>, params: &Params) -> Markup {
    let Some(rows) = facts.branches.as_ref().filter(|rows| !rows.is_empty()) else {
        return absent("This run has no table of branches (branches.tsv).");
    };
    let unit = Unit::of(facts.tree);
    let order = shown(rows, params.max_rows);
    html! {
        p.note {
            @if order.len() < rows.len() {
                "The " (order.len()) " longest of " (rows.len()) " branches; branches.tsv has all, with more columns. "
            } @else {
                "All " (rows.len()) " branches; branches.tsv has more columns. "
            }
            span.with-script { "A click on a heading sorts." }
        }
        div.tall { (branch_table(rows, &order, unit)) }
        (narrow_places(facts, unit))
    }
}

/// The rows on the page: all, or the longest branches in the table's order.
fn shown(rows: &Rows, max_rows: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..rows.len()).collect();
    if rows.len() > max_rows {
        let lengths = rows.numbers("length_mm");
        order.sort_by(|&a, &b| lengths[b].total_cmp(&lengths[a]).then(a.cmp(&b)));
        order.truncate(max_rows);
        order.sort_unstable();
    }
    order
}

fn branch_table(rows: &Rows, order: &[usize], unit: Unit) -> Markup {
    let has_names = (0..rows.len()).any(|row| !rows.text(row, "label_name").is_empty());
    let columns: Vec<&str> = COLUMNS
        .into_iter()
        .filter(|name| rows.column(name).is_some() && (has_names || *name != "label_name"))
        .collect();
    let names: Vec<String> = columns.iter().map(|column| heading(column, unit)).collect();
    let measures = branch_measures();
    let meaning = |column: &str| {
        measures.iter().find(|m| m.column.name == column).map_or("", |measure| measure.column.meaning)
    };
    let heads: Vec<Head<'_>> = columns
        .iter()
        .zip(&names)
        .map(|(column, name)| Head { name, meaning: meaning(column), is_number: *column != "label_name" })
        .collect();
    let digits: Vec<Option<usize>> = columns.iter().map(|column| decimals(rows, column, unit)).collect();
    let cell = |row: usize, column: &str, digits: Option<usize>| -> Markup {
        let text = rows.text(row, column);
        let is_length = column.ends_with(MM) && !column.contains("_per_");
        match text.parse::<f64>() {
            Ok(value) => match digits {
                Some(decimals) => {
                    html! { (fixed(if is_length { value / unit.mm } else { value }, decimals)) }
                }
                None => html! { (text) },
            },
            Err(_) => html! { (text) },
        }
    };
    let cells: Vec<Vec<Markup>> = order
        .iter()
        .map(|&row| columns.iter().zip(&digits).map(|(column, digits)| cell(row, column, *digits)).collect())
        .collect();
    table("sortable branches", &heads, &cells)
}

/// The decimals of a column: four digits of its largest number. None for names, indices and counts.
fn decimals(rows: &Rows, column: &str, unit: Unit) -> Option<usize> {
    if !(column.ends_with(MM)
        || column.ends_with("_deg")
        || ["tortuosity", "radius_to_parent"].contains(&column))
    {
        return None;
    }
    let scale = if column.contains("_per_") || !column.ends_with(MM) { 1.0 } else { unit.mm };
    let most = rows.numbers(column).into_iter().map(|value| (value / scale).abs()).filter(|v| v.is_finite());
    let most = most.fold(0.0, f64::max);
    let exponent = if most > 0.0 { math::floor(math::log10(most)) as i64 } else { 0 };
    Some(usize::try_from(3 - exponent).unwrap_or(0).min(9))
}

/// A column's name as a heading: words, and the unit that is shown.
fn heading(column: &str, unit: Unit) -> String {
    match column {
        "taper_mm_per_mm" => "taper".to_owned(),
        "branching_angle_deg" => "branching angle (°)".to_owned(),
        "label_name" => "label".to_owned(),
        column => match column.strip_suffix(MM) {
            Some(name) => format!("{} ({})", name.replace('_', " "), unit.sign),
            None => column.replace('_', " "),
        },
    }
}

fn narrow_places(facts: &Facts<'_>, unit: Unit) -> Markup {
    let Some(rows) = &facts.stenoses else { return html! {} };
    if rows.is_empty() {
        let limit = facts.setting("tree.stenosis_percent").unwrap_or("the limit");
        return html! { h3 { "Narrow places" } p { "None: no place is narrower than before and after it by " (limit) " % or more." } };
    }
    let sign = |name: &str| format!("{name} ({})", unit.sign);
    let names = [
        "narrowing (%)".to_owned(),
        "branch".to_owned(),
        sign("radius"),
        sign("reference"),
        sign("from root"),
        "where (R, A, S mm)".to_owned(),
    ];
    let heads: Vec<Head<'_>> =
        names.iter().enumerate().map(|(i, name)| Head { name, meaning: "", is_number: i < 5 }).collect();
    let cells = (0..rows.len().min(MAX_STENOSES)).map(|row| {
        let length = |column: &str| html! { (number(rows.number(row, column) / unit.mm, 4)) };
        let place = ["x_mm", "y_mm", "z_mm"].map(|column| number(rows.number(row, column), 4)).join(", ");
        vec![
            html! { (number(rows.number(row, "narrowing_percent"), 3)) },
            html! { (rows.text(row, "branch")) },
            length("radius_mm"),
            length("reference_radius_mm"),
            length("from_root_mm"),
            html! { (place) },
        ]
    });
    let cells: Vec<Vec<Markup>> = cells.collect();
    html! {
        h3 { "Narrow places" }
        p.note {
            "Candidates for looking at, the narrowest first; the radius against the smaller of the largest before and after. "
            @if rows.len() > MAX_STENOSES { "The first " (MAX_STENOSES) " of " (rows.len()) "; stenoses.tsv has all." }
        }
        (table("sortable", &heads, &cells))
    }
}
