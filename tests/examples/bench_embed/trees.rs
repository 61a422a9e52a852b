//! The trees to measure on: SWC files of folders, or phantoms.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use espalier_model::Tree;
use espalier_model::swc::{self, SwcScale};
use espalier_phantom::{Kind, Params, grow_tree};
use glam::DVec3;

use crate::{Mode, Options, scale};

/// The word that names an airway instead of a file: one of 4099 nodes, of which no choice of sides is free of crossings.
const CROWDED_AIRWAY: &str = "g9";

/// A tree and what to call it.
pub(crate) struct Named {
    pub(crate) name: String,
    pub(crate) tree: Tree,
}

/// Trees whose axes differ in their unit, by the beginning of the file's name: DIADEM's olfactory fibres are traced in
/// pixels and slices.
const SCALES: [(&str, [f64; 3]); 1] = [("diadem_OP_", [0.33, 0.33, 1.0])];

/// The trees that the options ask for, small ones first; files that are no tree are named and left out.
pub(crate) fn trees(options: &Options) -> Result<Vec<Named>, Box<dyn Error>> {
    let mut trees = match &options.paths[..] {
        _ if options.has_sizes => scale::trees(options.largest)?,
        [] => phantoms()?,
        paths => of_files(paths)?,
    };
    if options.paths.is_empty() && !options.has_sizes && options.mode == Mode::Ablation {
        trees.push(crowded_airway()?);
    }
    trees.retain(|named| named.tree.n_nodes() <= options.largest);
    trees.sort_by_key(|named| named.tree.n_nodes());
    Ok(trees)
}

fn crowded_airway() -> Result<Named, Box<dyn Error>> {
    Ok(Named { name: "airway g9".to_owned(), tree: scale::airway(9, 0.8, 2.0)? })
}

fn phantoms() -> Result<Vec<Named>, Box<dyn Error>> {
    let mut trees = Vec::new();
    for kind in [Kind::Neuron, Kind::Airway, Kind::Vessel] {
        for seed in 0..3 {
            trees.push(Named {
                name: format!("{} {seed}", kind.name()),
                tree: grow_tree(kind, &Params::default(), seed)?,
            });
        }
    }
    for n_nodes in [1000, 3000] {
        let params = Params { n_nodes, ..Params::default() };
        trees.push(Named { name: "neuron 0".to_owned(), tree: grow_tree(Kind::Neuron, &params, 0)? });
    }
    Ok(trees)
}

fn of_files(paths: &[PathBuf]) -> Result<Vec<Named>, Box<dyn Error>> {
    let (mut files, mut trees) = (Vec::new(), Vec::new());
    let mut pending = paths.to_vec();
    while let Some(path) = pending.pop() {
        if path.as_os_str() == CROWDED_AIRWAY && !path.exists() {
            trees.push(crowded_airway()?);
        } else if path.is_dir() {
            for entry in fs::read_dir(&path)? {
                pending.push(entry?.path());
            }
        } else if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("swc")) {
            files.push(path);
        }
    }
    files.sort();
    for file in files {
        match of_file(&file) {
            Ok(tree) => trees.push(Named { name: name_of(&file), tree }),
            Err(error) => println!("left out: {}: {error}", file.display()),
        }
    }
    Ok(trees)
}

/// The file's stem; the folder's name for the `tree.swc` of a run folder.
fn name_of(file: &Path) -> String {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let own = stem(file);
    let folder = file.parent().map(stem).unwrap_or_default();
    if own == "tree" { folder } else { own }
}

/// The tree of a file, as the tree stage makes it by default.
pub(crate) fn of_file(file: &Path) -> Result<Tree, Box<dyn Error>> {
    let bytes = fs::read(file)?;
    if swc::is_own(&bytes) {
        return Ok(swc::read_tree(std::str::from_utf8(&bytes)?)?);
    }
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let axes = SCALES.iter().find(|(start, _)| name.starts_with(start)).map_or([1.0; 3], |(_, axes)| *axes);
    let scale = SwcScale { position_mm: DVec3::from_array(axes) * 1e-3, radius_mm: 1e-3 };
    let (traced, _) = swc::parse(&bytes, &scale)?;
    Ok(espalier_tree::from_traced(&traced, &espalier_tree::Params::default())?.tree)
}
