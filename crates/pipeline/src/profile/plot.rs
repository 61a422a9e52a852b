//! The calibre on a way, as a picture.
//!
//! **Input** a run folder, a place, a file to write. **Output** that file, SVG or PNG by its ending.
//! **Steps** 1. The rows of the way. 2. The narrow places of `stenoses.tsv` on it; the narrowest of them, or where there is
//! none, the row that falls furthest short of its reference. 3. What branches of each generation on the way have, from
//! `generations.tsv`. 4. The chart, with the settings of the run's pictures.
//! **Guarantees** no result of the run is overwritten.

use std::path::PathBuf;

use espalier_model::Tree;
use espalier_model::anatomy::{ProfileRow, Spread, Stenosis};
use espalier_render::Stretch;
use espalier_report::Rows;
use glam::DVec3;

use super::{Way, WayTo};
use crate::config::{Config, Override};
use crate::error::Error;
use crate::folder::{RunFolder, write_file};
use crate::run::boxed;
use crate::settings;
use crate::stage::Stage;

const GENERATIONS: &str = "generations.tsv";
const STENOSES: &str = "stenoses.tsv";

/// A plot to be made.
#[derive(Clone, Debug)]
pub struct PlotRequest {
    /// The run folder.
    pub folder: PathBuf,
    /// Where the way leads.
    pub way_to: WayTo,
    /// The file to write, `.svg` or `.png`.
    pub plot: PathBuf,
    /// Changes of `render.*`.
    pub overrides: Vec<Override>,
}

/// What a plot came to.
#[derive(Clone, Debug, PartialEq)]
pub struct Plotted {
    /// The narrowest place on the way against its reference; none where no row falls short of one.
    pub narrowest: Option<Stenosis>,
    /// Whether `stenoses.tsv` lists it.
    pub is_listed: bool,
}

/// Draws the way from the root to a place.
///
/// # Errors
/// As [`profile`](super::profile()); a file that is neither `.svg` nor `.png`, that is a result of the run, or that cannot
/// be written; a setting that is not one of pictures.
pub fn plot_profile(request: &PlotRequest) -> Result<Plotted, Error> {
    let path = &request.plot;
    let ending = path.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
    let is_svg = match ending.as_deref() {
        Some("svg") => true,
        Some("png") => false,
        _ => return Err(Error::PlotFormat { path: path.clone() }),
    };
    let run = RunFolder::to_read(&request.folder);
    if run.has_result_at(path) {
        return Err(Error::ResultInTheWay { path: path.clone() });
    }
    let way = Way::read(&run, request.way_to)?;
    let config = config_of(&run, &request.overrides)?;
    let rows: Vec<ProfileRow> = way.rows.iter().map(super::Row::values).collect();
    let candidates = candidates(&run, &rows)?;
    let narrowest = candidates.first().cloned().or_else(|| narrowest(&way.tree, &rows));
    let drawn = espalier_render::profile(
        &espalier_render::Way {
            title: title(&way, &config),
            rows: &rows,
            stretches: &stretches(&run, &way.tree, &rows)?,
            candidates: &candidates,
            narrowest: narrowest.as_ref(),
        },
        &config.render,
    )
    .map_err(|error| Error::stage(Stage::Render)(boxed(error)))?;
    write_file(path, if is_svg { drawn.svg.as_bytes() } else { &drawn.png })?;
    Ok(Plotted { narrowest, is_listed: !candidates.is_empty() })
}

/// The config of the run under what may still be changed.
fn config_of(run: &RunFolder, overrides: &[Override]) -> Result<Config, Error> {
    if let Some(other) = overrides.iter().find(|set| !set.key.starts_with("render.")) {
        return Err(Error::Settled { key: other.key.clone(), folder: run.path().to_owned() });
    }
    let text = String::from_utf8_lossy(&run.read(settings::FILE)?).into_owned();
    Config::parse(&text, &run.path().join(settings::FILE), overrides).map_err(Error::from)
}

fn title(way: &Way, config: &Config) -> String {
    let branch = way.tree.branches().of_node(way.end).unwrap_or(0);
    let is_tip = way.tree.children(way.end).is_empty();
    let is_end = way.tree.branches().list().get(branch).is_some_and(|branch| branch.end() == way.end);
    let place = match (is_tip, is_end) {
        (true, _) => format!("the tip of branch {branch}"),
        (_, true) => format!("the end of branch {branch}"),
        _ => format!("node {} of branch {branch}", way.end),
    };
    let named = config.render.title.as_deref().or(config.own_name());
    named.map_or_else(|| format!("Calibre to {place}"), |name| format!("{name}: calibre to {place}"))
}

/// The narrow places that the run lists on the way, the narrowest first.
fn candidates(run: &RunFolder, rows: &[ProfileRow]) -> Result<Vec<Stenosis>, Error> {
    let listed = run.text_if_there(STENOSES)?.map(|text| Rows::parse(&text)).unwrap_or_default();
    let whole = |row, column| listed.text(row, column).parse::<usize>().ok();
    let end_mm = rows.last().map_or(0.0, |row| row.from_root_mm);
    let mut found = Vec::new();
    for row in 0..listed.len() {
        let (Some(branch), Some(node)) = (whole(row, "branch"), whole(row, "node")) else { continue };
        let number = |column| listed.number(row, column);
        let place = Stenosis {
            branch,
            node,
            position_mm: DVec3::new(number("x_mm"), number("y_mm"), number("z_mm")),
            from_root_mm: number("from_root_mm"),
            radius_mm: number("radius_mm"),
            reference_radius_mm: number("reference_radius_mm"),
            narrowing_percent: number("narrowing_percent"),
        };
        if place.from_root_mm <= end_mm && rows.iter().any(|row| row.branch == branch) {
            found.push(place);
        }
    }
    found.sort_by(|a, b| b.narrowing_percent.total_cmp(&a.narrowing_percent));
    Ok(found)
}

/// The row that falls furthest short of its reference, the first of several.
fn narrowest(tree: &Tree, rows: &[ProfileRow]) -> Option<Stenosis> {
    let short = rows.iter().rev().filter(|row| row.narrowing_percent > 0.0);
    let row = short.max_by(|a, b| a.narrowing_percent.total_cmp(&b.narrowing_percent))?;
    Some(Stenosis {
        branch: row.branch,
        node: row.node,
        position_mm: tree.position_mm(row.node),
        from_root_mm: row.from_root_mm,
        radius_mm: row.radius_mm,
        reference_radius_mm: row.reference_radius_mm,
        narrowing_percent: row.narrowing_percent,
    })
}

/// The branches on the way, with what their generations have.
fn stretches(run: &RunFolder, tree: &Tree, rows: &[ProfileRow]) -> Result<Vec<Stretch>, Error> {
    let usual = run.text_if_there(GENERATIONS)?.map(|text| Rows::parse(&text)).unwrap_or_default();
    let branches = tree.branches();
    let stretch = |branch: usize| {
        let generation = branches.list().get(branch).map_or(0, |branch| branch.generation);
        let is_own = |row: &usize| usual.text(*row, "generation").parse() == Ok(generation);
        let usual_mm = (0..usual.len()).find(is_own).map_or(Spread { mean: f64::NAN, sd: f64::NAN }, |row| {
            Spread { mean: usual.number(row, "radius_mean_mm"), sd: usual.number(row, "radius_sd_mm") }
        });
        Stretch { branch, generation, usual_mm }
    };
    Ok(rows.chunk_by(|a, b| a.branch == b.branch).map(|rows| stretch(rows[0].branch)).collect())
}
