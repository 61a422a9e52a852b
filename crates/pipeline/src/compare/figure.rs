//! The figures of a comparison: `compare.png` and `compare.svg`, `convergence.png` and `convergence.svg`.
//!
//! Where the table says that edges cross, the pairs are found from the coordinates. `verify` counts all of them again.

use espalier_model::{Comparison, Tree, ViewHierarchy};
use espalier_render::{Compass, Error, Panel, Params, Searched, Section};

/// The most crossings that are marked in a panel.
const MOST_RINGS: usize = 5000;

/// A run as the figure shows it.
pub(crate) struct Subject<'a> {
    /// What to call it, if there are several.
    pub(crate) name: Option<&'a str>,
    pub(crate) tree: &'a Tree,
    pub(crate) views: &'a ViewHierarchy,
    pub(crate) comparison: &'a Comparison,
    pub(crate) compass: Compass,
}

/// Draws the layouts of every run beside its tree in space; gives the files.
pub(crate) fn draw(subjects: &[Subject<'_>], params: &Params) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let sections: Vec<Section<'_>> = subjects.iter().map(section).collect();
    let figure = espalier_render::side_by_side(&sections, params)?;
    Ok(vec![("compare.png".to_owned(), figure.png), ("compare.svg".to_owned(), figure.svg.into_bytes())])
}

/// Draws the energy of a run's methods against their work; gives the files.
pub(crate) fn convergence(comparison: &Comparison, params: &Params) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let methods: Vec<Searched<'_>> = comparison
        .layouts
        .iter()
        .enumerate()
        .map(|(idx, layout)| Searched {
            row: &layout.row,
            trace: &layout.trace,
            is_chosen: idx == comparison.chosen,
        })
        .collect();
    let figure = espalier_render::convergence(&methods, params)?;
    Ok(vec![
        ("convergence.png".to_owned(), figure.png),
        ("convergence.svg".to_owned(), figure.svg.into_bytes()),
    ])
}

fn section<'a>(subject: &Subject<'a>) -> Section<'a> {
    let Subject { name, tree, views, comparison, compass } = *subject;
    // Looking for what is known not to be there costs as much as finding it.
    let pairs = |layout: &espalier_model::ComparedLayout| match layout.row.crossings {
        0 => Vec::new(),
        _ => espalier_embed::crossing_pairs(tree, &layout.positions_mm, MOST_RINGS),
    };
    let panel = |(idx, layout): (usize, &'a espalier_model::ComparedLayout)| Panel {
        row: &layout.row,
        positions_mm: &layout.positions_mm,
        crossings: pairs(layout),
        is_chosen: idx == comparison.chosen,
    };
    let panels = comparison.layouts.iter().enumerate().map(panel).collect();
    Section { name, tree, view: &views.global, compass, panels }
}

/// The letters at the edges of a view. Only a scan says where right and left of the patient are.
pub(crate) fn compass(asked: Compass, is_of_scan: bool) -> Compass {
    match asked {
        Compass::Auto if is_of_scan => Compass::Anatomical,
        Compass::Auto => Compass::Axes,
        asked => asked,
    }
}
