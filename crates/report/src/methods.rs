//! What was done, in sentences for a methods section, with what they cite.
//!
//! **Input** the facts: which stages ran, with which settings, and what they counted. **Output** the same sentences as
//! HTML and as Markdown with citation keys, and the cited publications as BibTeX.
//! **Guarantees** a sentence stands only where the stage that it speaks of ran in this run; nothing that a user typed but
//! numbers and choices from lists is repeated.

use espalier_model::LedgerKind;
use maud::{Markup, html};

use crate::bibliography::Publication;
use crate::facts::{Facts, InputKind};
use crate::length::{Unit, counted, number};
use crate::verdict::{degrees, percent};

/// The methods of a run.
#[derive(Clone, Debug)]
pub(crate) struct Written {
    pub(crate) html: Markup,
    pub(crate) markdown: String,
    pub(crate) bibtex: String,
}

/// Writes the methods; a citation is a key in brackets.
pub(crate) fn write(facts: &Facts<'_>) -> Written {
    let paragraphs: Vec<String> = [segmentation(facts), centreline(facts), embedding(facts), measures(facts)]
        .into_iter()
        .filter(|paragraph| !paragraph.is_empty())
        .map(|sentences| sentences.join(" "))
        .collect();
    let cited = cited(&paragraphs);
    let references: String =
        cited.iter().map(|publication| publication.bibtex()).collect::<Vec<_>>().join("\n");
    let list: String = cited.iter().map(|p| format!("- **{}** {}\n", p.key, p.long())).collect();
    let with_keys: Vec<String> = paragraphs.iter().map(|paragraph| pandoc(paragraph)).collect();
    Written {
        html: as_html(&paragraphs, &cited),
        markdown: format!("# Methods\n\n{}\n\n## References\n\n{list}", with_keys.join("\n\n")),
        bibtex: references,
    }
}

fn segmentation(facts: &Facts<'_>) -> Vec<String> {
    let mut sentences = Vec::new();
    match facts.input_kind {
        InputKind::PhantomScan | InputKind::PhantomTree => {
            sentences
                .push("The input is a synthetic phantom with known truth, not data of a patient.".to_owned());
        }
        InputKind::Volume | InputKind::Tree => {}
    }
    let ran = |stage: &str| facts.stages.iter().any(|facts| facts.stage == stage);
    if !ran("volume") {
        return sentences;
    }
    sentences.extend(selection(facts));
    if let Some(voxels) = facts.count("volume", "foreground_voxels") {
        let millilitres = facts.count("volume", "foreground_ml").unwrap_or(f64::NAN);
        sentences.push(format!(
            "After components were selected and cavities filled it has {} voxels ({} ml).",
            number(voxels, 12),
            number(millilitres, 4)
        ));
    }
    sentences
}

/// How the voxels were chosen.
fn selection(facts: &Facts<'_>) -> Vec<String> {
    let count = |name| facts.count("volume", name);
    let setting = |key| facts.setting(key).filter(|&value| value != "not set");
    let end = |name, key| count(name).or_else(|| setting(key)?.parse().ok());
    let band = match (end("band_lower", "volume.lower"), end("band_upper", "volume.upper")) {
        (Some(lower), Some(upper)) => format!("from {} to {}", number(lower, 5), number(upper, 5)),
        (Some(lower), None) => format!("from {} on", number(lower, 5)),
        (None, Some(upper)) => format!("up to {}", number(upper, 5)),
        (None, None) if setting("volume.label").is_some() => {
            return vec!["The mask is one or more labels of a label map.".to_owned()];
        }
        (None, None) => return vec!["The mask was taken from the input.".to_owned()],
    };
    let was_found = count("seed_candidates").is_some();
    let is_given = ["volume.seed_voxel", "volume.seed_mm"].into_iter().any(|key| setting(key).is_some());
    if !was_found && !is_given {
        return vec![format!("The mask is all voxels with values {band}.")];
    }
    let mut sentences = vec![format!(
        "The mask was grown from a seed over 6-connected voxels with values {band} [Adams1994]."
    )];
    if was_found {
        sentences.push("The seed was found in the trachea.".to_owned());
    }
    let is_found = setting("volume.lower").or(setting("volume.upper")).is_none();
    let half = count("half_maximum").filter(|&half| count("band_lower") == Some(half));
    if let (Some(_), Some(inside), Some(outside)) = (half, count("value_inside"), count("value_outside")) {
        sentences.push(format!(
            "The threshold is half-way between the medians of the values inside, {}, and outside, {} [Ridler1978].",
            number(inside, 5),
            number(outside, 5)
        ));
    } else if count("stable_threshold").is_some() && is_found {
        sentences.push(
            "The threshold is the last before the region leaks through the wall [Mori1996], or one that keeps clear of \
             the leak's beginning."
                .to_owned(),
        );
    }
    if let (Some(edges), Some(n_won)) = (count("edges_threshold"), count("edges_voxels")) {
        sentences.push(format!(
            "Up to {} it also grew over edges and corners, by {} voxels.",
            number(edges, 5),
            number(n_won, 12)
        ));
    }
    sentences
}

fn centreline(facts: &Facts<'_>) -> Vec<String> {
    let ran = |stage: &str| facts.stages.iter().any(|facts| facts.stage == stage);
    let (tree, unit) = (facts.tree, Unit::fit(0.1 * facts.tree.length_mm()));
    let mut sentences = Vec::new();
    if ran("skeleton") {
        sentences.push(match facts.setting("skeleton.thinning") {
            Some("lee94") => "The mask was thinned to a curve skeleton as published [Lee94].".to_owned(),
            _ => "The mask was thinned to a curve skeleton by a variant of a published rule [Lee94] that keeps components, tunnels and the length of tubes.".to_owned(),
        });
    }
    if ran("radius") {
        sentences.push("At each skeleton voxel the radius was measured against the background of the mask, with centres below the size of a voxel.".into());
        sentences.extend(walls(facts));
    }
    let n_of = |kind| facts.ledger.map_or(0, |ledger| ledger.n_of(kind));
    if facts.is_of_scan() && facts.ledger.is_some() {
        sentences.push(format!(
            "The skeleton became a rooted tree: {} cut, {} pruned, {} dropped; each is listed with place and reason.",
            counted(n_of(LedgerKind::LoopCut), "loop was", "loops were"),
            counted(n_of(LedgerKind::SpurPruned), "spur was", "spurs were"),
            counted(n_of(LedgerKind::ComponentDropped), "component was", "components were"),
        ));
        sentences
            .push("Its lines were smoothed and thinned out within a tolerance [Douglas1973].".to_owned());
    } else if !facts.is_of_scan() {
        sentences.push("The tree was taken from a tracing.".to_owned());
    }
    sentences.push(format!(
        "It has {}, {} and a length of {}.",
        counted(tree.branches().list().len(), "branch", "branches"),
        counted(tree.n_tips(), "tip", "tips"),
        unit.text(tree.length_mm(), 4)
    ));
    sentences
}

/// How radii came from the mask to the wall.
fn walls(facts: &Facts<'_>) -> Option<String> {
    let count = |name| facts.count("radius", name);
    let (n_walls, n_spheres) = (count("walls")?, count("spheres")?);
    if 2.0 * n_walls < n_spheres {
        return Some("Radii keep to the mask: the scan shows too few walls.".to_owned());
    }
    Some(format!(
        "Radii reach to the wall in the scan: a blurred tube was fitted to the values along rays across the branch \
         [Reinhardt1997], at {} of {} voxels; on average it lies {} mm beyond the mask.",
        number(n_walls, 12),
        number(n_spheres, 12),
        number(count("wall_beyond_mean_mm")?, 3)
    ))
}

fn embedding(facts: &Facts<'_>) -> Vec<String> {
    let embedding = facts.embedding;
    let mut sentences = vec![match facts.setting("views.metric") {
        Some("kl") => "Views of the whole and of its parts were chosen by a divergence of information [Feixas2009], as published [Hu2022].".to_owned(),
        _ => "Views of the whole and of its parts were chosen by how little they foreshorten, after a published metric [Hu2022].".to_owned(),
    }];
    sentences.push(method_sentence(&embedding.method));
    let others = embedding.methods.iter().map(|row| row.method.as_str());
    let mut others: Vec<&str> = others.filter(|method| *method != embedding.method).collect();
    // The swarm may stand there for several kinds of targets.
    others.dedup();
    if !others.is_empty() {
        let has = |name: &str| others.iter().any(|method| method.starts_with(name));
        let marino = if has("marino") { " Marino is a reconstruction of [Marino2015]." } else { "" };
        let pso =
            if has("pso") { " The particle swarm is that of [Hu2022] after [Kennedy1995]." } else { "" };
        sentences.push(format!(
            "Scored by the same energy against the same targets: {}.{marino}{pso}",
            others.join(", ")
        ));
    }
    let losses = &embedding.losses;
    if embedding.certificate.holds() {
        sentences.push("Exact predicates [Shewchuk1997] over the coordinates as written certify that no two edges cross.".into());
    } else {
        sentences.push(format!(
            "By exact predicates [Shewchuk1997] {}.",
            counted(embedding.certificate.crossings, "pair of edges crosses", "pairs of edges cross")
        ));
    }
    sentences.push(format!(
        "Edges lose {} of their length on average ({} at most); angles are {} off those in space on average ({} at most).",
        percent(losses.length_loss_mean),
        percent(losses.length_loss_max),
        degrees(losses.angle3d_error_mean_deg),
        degrees(losses.angle3d_error_max_deg)
    ));
    sentences.extend(picture(facts));
    sentences
}

/// What the picture shows beside the tree.
fn picture(facts: &Facts<'_>) -> Option<String> {
    let setting = |key| facts.setting(key).unwrap_or_default();
    if setting("render.style") != "volume" {
        return None;
    }
    let slab_mm: f64 = setting("render.volume.slab_mm").parse().unwrap_or(0.0);
    let gathered = match setting("render.volume.slab") {
        "mip" => "largest value",
        "minip" => "smallest value",
        _ => "mean",
    };
    let slab = if slab_mm > 0.0 {
        format!("the {gathered} over a slab of {} mm", number(slab_mm, 4))
    } else {
        "trilinear between voxels".to_owned()
    };
    Some(format!(
        "The picture shows the scan along the branches, {slab}: a curved planar reformation [Kanitsar2002] of the whole \
         tree at once."
    ))
}

fn method_sentence(method: &str) -> String {
    let how = match method {
        method if method.starts_with("solver") => {
            "the sides of turns were searched by annealing [Kirkpatrick1983], then lengths and angles gave way together, always without crossings, to the energy of [Hu2022]"
        }
        method if method.starts_with("marino") => {
            "a radial layout bent towards one view [Marino2015], reconstructed"
        }
        method if method.starts_with("pso") => "a particle swarm [Kennedy1995] over the energy of [Hu2022]",
        method if method.starts_with("radial") => "a radial layout by numbers of tips",
        method if method.starts_with("projection") => "the projection along the best view",
        _ => "the layout with the least energy [Hu2022]",
    };
    format!("The tree was laid flat by the method {method}: {how}.")
}

fn measures(facts: &Facts<'_>) -> Vec<String> {
    let mut sentences = Vec::new();
    if facts.branches.is_some() {
        sentences.push("Branches run from fork to fork; generations count forks from the root, Strahler orders [Strahler1957] from the tips.".to_owned());
        sentences.push(
            "Murray's exponent [Murray1926] is solved at each fork from the mean radii of its branches."
                .to_owned(),
        );
    }
    sentences.push("Stress is Kruskal's [Kruskal1964], of the distances between nodes in the plane against those in space.".to_owned());
    sentences.push(format!(
        "All was done by {} with seed {}; the same input and settings give the same bytes. Colours are from ColorBrewer [ColorBrewer].",
        facts.program, facts.seed
    ));
    sentences
}

/// A text in parts: words, or a publication.
enum Part<'a> {
    Words(&'a str),
    Cited(&'static Publication),
}

/// Cuts a text at its citations.
fn parts(text: &str) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let (mut begun, mut from) = (0, 0);
    while let Some(open) = text[from..].find('[').map(|at| from + at) {
        let Some(close) = text[open..].find(']').map(|at| open + at) else { break };
        from = open + 1;
        if let Some(publication) = Publication::find(&text[open + 1..close]) {
            parts.extend([Part::Words(&text[begun..open]), Part::Cited(publication)]);
            (begun, from) = (close + 1, close + 1);
        }
    }
    parts.push(Part::Words(&text[begun..]));
    parts
}

/// The publications in the order of their first citation.
fn cited(paragraphs: &[String]) -> Vec<&'static Publication> {
    let mut cited: Vec<&'static Publication> = Vec::new();
    for part in paragraphs.iter().flat_map(|paragraph| parts(paragraph)) {
        if let Part::Cited(publication) = part
            && cited.iter().all(|known| known.key != publication.key)
        {
            cited.push(publication);
        }
    }
    cited
}

fn pandoc(paragraph: &str) -> String {
    parts(paragraph)
        .iter()
        .map(|part| match part {
            Part::Words(words) => (*words).to_owned(),
            Part::Cited(publication) => format!("[@{}]", publication.key),
        })
        .collect()
}

fn as_html(paragraphs: &[String], cited: &[&'static Publication]) -> Markup {
    html! {
        p.note { "Generated from what ran, to be shortened; the same text with citation keys is in provenance/methods.md, its references in provenance/references.bib." }
        @for paragraph in paragraphs {
            p {
                @for part in parts(paragraph) {
                    @match part {
                        Part::Words(words) => (words),
                        Part::Cited(publication) => { "(" a href={ "#ref-" (publication.key) } { (publication.short) } ")" },
                    }
                }
            }
        }
        h3 { "References" }
        ol.references { @for publication in cited { li id={ "ref-" (publication.key) } { (publication.long()) } } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn citations_are_found_and_other_brackets_are_not() {
        let text = "As in [Hu2022], not [here] or [; see [Lee94].";
        assert_eq!(pandoc(text), "As in [@Hu2022], not [here] or [; see [@Lee94].");
        let keys: Vec<&str> =
            cited(&[text.to_owned(), "[Hu2022]".to_owned()]).iter().map(|p| p.key).collect();
        assert_eq!(keys, ["Hu2022", "Lee94"]);
        assert_eq!(pandoc("[é [Hu2022"), "[é [Hu2022");
    }
}
