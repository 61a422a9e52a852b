//! Tree, views and embedding → pictures.

use espalier_model::Report;
use espalier_render::{ColorBy, SpaceSubject, Style};

use super::{Outcome, Step};
use crate::artifacts::Artifacts;
use crate::compare::figure;
use crate::error::Error;
use crate::estimate::Sizes;
use crate::labels;
use crate::page;
use crate::scan_of_map;
use crate::space;

pub(super) fn render(step: &mut Step<'_>) -> Result<Outcome, Error> {
    let tree = step.take(Artifacts::tree)?;
    let views = step.take(Artifacts::views)?;
    let embedding = step.take(Artifacts::embedding)?;
    let comparison = step.take(Artifacts::comparison)?;
    let mut params = step.config.render.clone();
    let mask = if params.space && page::has_mask(step) { Some(step.take(Artifacts::mask)?) } else { None };
    let sizes = mask.as_deref().map(Sizes::of_mask).unwrap_or_default();
    step.must_fit(&sizes.and_tree(&tree).and_pictures(&params))?;
    params.title = params.title.or_else(|| step.config.own_name().map(str::to_owned));
    params.compass = figure::compass(params.compass, step.artifacts.is_of_scan);
    params.labels = labels::labels(step, &tree)?;
    let (made, report) = if params.style == Style::Volume {
        let (scan, report) = scan_of_map::of_tree(step, &tree, &params)?;
        (espalier_render::render_scan((&tree, &embedding, &views), &scan, &params), report)
    } else {
        (espalier_render::render(&tree, &embedding, &views, &params), Report::default())
    };
    let made = made.map_err(|error| step.failed(error))?;
    let mut report = Report { warnings: [report.warnings, made.report.warnings].concat(), ..made.report };
    let mut files = vec![
        ("planar.png".to_owned(), made.png),
        ("planar.svg".to_owned(), made.svg.into_bytes()),
        ("global-view.png".to_owned(), made.global_view_png),
    ];
    if let Some(pdf) = made.pdf {
        files.push(("planar.pdf".to_owned(), pdf));
    }
    if let Some(exr) = made.exr {
        files.push(("planar.exr".to_owned(), exr));
    }
    if params.space {
        let figure = space::figure(
            step,
            &SpaceSubject {
                tree: &tree,
                embedding: &embedding,
                view: &views.global,
                organ: None,
                turn_deg: made.turn_deg,
            },
            &params,
        )?;
        files.extend(figure);
    }
    if let Some(comparison) = comparison {
        let compass = params.compass;
        let subject =
            figure::Subject { name: None, tree: &tree, views: &views, comparison: &comparison, compass };
        files.extend(figure::draw(&[subject], &params).map_err(|error| step.failed(error))?);
        files.extend(figure::convergence(&comparison, &params).map_err(|error| step.failed(error))?);
    }
    let is_plain = || tree.edges().all(|(node, _)| tree.nodes()[node].kind == 0);
    if params.color_by == ColorBy::Label && params.labels.is_none() && is_plain() {
        let message =
            "no branch has a label to be coloured by: name a label map, such as lobes, in tree.labels";
        report.warn("W-RENDER-LABEL", message.to_owned());
    }
    let line = files.iter().map(|(file, _)| file.as_str()).collect::<Vec<_>>().join(", ");
    Ok(Outcome { files, report, line })
}
