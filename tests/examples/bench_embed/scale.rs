//! Time against size.

use std::error::Error;

use espalier_embed::{Method, Params};
use espalier_model::Tree;
use espalier_phantom::{Kind, grow_tree};

use crate::Options;
use crate::measure::{measure, short, views};
use crate::trees::Named;

/// Nodes of the neurons.
const NEURONS: [usize; 8] = [100, 235, 300, 1000, 3000, 10_000, 30_000, 60_000];
/// Airways by their generations, thinnest branch in mm, and distance of their nodes in mm: 221 to 66,481 nodes.
const AIRWAYS: [(u32, f64, f64); 5] =
    [(5, 1.2, 6.0), (7, 1.2, 4.0), (9, 0.8, 2.0), (10, 0.5, 1.0), (12, 0.35, 0.5)];
/// The seconds that a tree may take, by nodes.
const MUST: [(usize, f64); 5] = [(235, 0.5), (1000, 2.0), (3000, 10.0), (10_000, 60.0), (60_000, 600.0)];

/// Prints the table; whether every result is certified.
pub(crate) fn print(options: &Options) -> Result<bool, Box<dyn Error>> {
    println!(
        "tree | N | M | E | E length+angle | Metric 2 mean | degrees mean / max | stress | sides s | solver s | total s | s per 1000 nodes | must s | crossings | termination"
    );
    println!("--- | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | --: | ---");
    let mut is_certified = true;
    for Named { name, tree } in trees(options.largest)? {
        let methods = vec![Method::Solver];
        match measure(&tree, &views(&tree)?, &Params { methods, ..Params::default() }) {
            Ok(measured) => {
                let (embedding, n_nodes) = (&measured.embedding, tree.n_nodes());
                let losses = &embedding.losses;
                let solver = measured.seconds_of("solver") - measured.targets_seconds;
                let cells = [
                    name,
                    n_nodes.to_string(),
                    tree.branches().list().len().to_string(),
                    short(embedding.energy.total()),
                    short(embedding.energy.length + embedding.energy.angle),
                    short(losses.angle3d_loss_mean),
                    format!(
                        "{} / {}",
                        short(losses.angle3d_error_mean_deg),
                        short(losses.angle3d_error_max_deg)
                    ),
                    format!("{:.3}", losses.stress),
                    format!("{:.3}", measured.targets_seconds),
                    format!("{solver:.3}"),
                    format!("{:.3}", measured.total_seconds),
                    format!("{:.3}", measured.total_seconds * 1000.0 / n_nodes as f64),
                    must(n_nodes),
                    embedding.certificate.crossings.to_string(),
                    embedding.termination.name().to_owned(),
                ];
                println!("{}", cells.join(" | "));
            }
            Err(error) => {
                is_certified = false;
                println!("{name} | {} | failed: {error}", tree.n_nodes());
            }
        }
    }
    Ok(is_certified)
}

/// The phantoms, neurons and airways, up to a size.
pub(crate) fn trees(largest: usize) -> Result<Vec<Named>, Box<dyn Error>> {
    let mut trees = Vec::new();
    for n_nodes in NEURONS.into_iter().filter(|&n_nodes| n_nodes <= largest) {
        let params = espalier_phantom::Params { n_nodes, ..espalier_phantom::Params::default() };
        trees.push(Named { name: "neuron".to_owned(), tree: grow_tree(Kind::Neuron, &params, 0)? });
    }
    for (generations, min_radius_mm, step_mm) in AIRWAYS {
        let tree = airway(generations, min_radius_mm, step_mm)?;
        if tree.n_nodes() > largest {
            break;
        }
        trees.push(Named { name: format!("airway g{generations}"), tree });
    }
    Ok(trees)
}

/// A grown airway with a node every so many mm.
pub(crate) fn airway(generations: u32, min_radius_mm: f64, step_mm: f64) -> Result<Tree, Box<dyn Error>> {
    use espalier_model::swc;
    use espalier_tree::{Resample, from_traced};
    let clearance_mm = min_radius_mm.min(2.5);
    let params = espalier_phantom::Params {
        generations,
        min_radius_mm,
        clearance_mm,
        ..espalier_phantom::Params::default()
    };
    let grown = grow_tree(Kind::Airway, &params, 0)?;
    let (traced, _) = swc::parse(swc::write(&grown, &[]).as_bytes(), &swc::SwcScale::millimetres())?;
    let resampled =
        espalier_tree::Params { resample: Resample::Step, step_mm, ..espalier_tree::Params::default() };
    Ok(from_traced(&traced, &resampled)?.tree)
}

/// The seconds asked for at a size, straight between the sizes that have one on logarithmic paper.
fn must(n_nodes: usize) -> String {
    let size = n_nodes as f64;
    let within = MUST.windows(2).find(|pair| (pair[0].0..=pair[1].0).contains(&n_nodes));
    within.map_or_else(
        || if n_nodes < MUST[0].0 { short(MUST[0].1) } else { "–".to_owned() },
        |pair| {
            let ((n0, s0), (n1, s1)) = (pair[0], pair[1]);
            let ln = espalier_geom::math::ln;
            let share = ln(size / n0 as f64) / ln(n1 as f64 / n0 as f64);
            short(s0 * espalier_geom::math::exp(share * ln(s1 / s0)))
        },
    )
}
