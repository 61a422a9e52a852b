//! What our tree of a mask has at each end of another program's skeleton of it:
//! `cargo run --release -p espalier-tests --example peer_ends -- MASK SKELETON`
#![allow(clippy::print_stdout, clippy::print_stderr, clippy::disallowed_methods, reason = "a program")]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use espalier_model::{Mask, Tree};
use espalier_tests::{ground_truth::phantoms::tree_of, peer_ends};
use espalier_tree::Root;

fn main() -> ExitCode {
    let arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [mask, peer] = arguments.as_slice() else {
        eprintln!("usage: peer_ends MASK SKELETON");
        return ExitCode::from(2);
    };
    match read(mask, peer) {
        Ok((tree, peer)) => {
            println!("   x (mm)   y (mm)   z (mm) tip (mm) curve (mm)  what ours has there");
            let ends = peer_ends::compare(&peer, &tree);
            ends.iter().for_each(|end| println!("{end}"));
            println!("{} ends of the peer, {} tips of ours and a root", ends.len(), tree.n_tips());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Our tree of the mask, and the peer's skeleton.
fn read(mask: &Path, peer: &Path) -> Result<(Tree, Mask), Box<dyn Error>> {
    let options = espalier_volume::ReadOptions::default();
    let params = espalier_volume::Params::default();
    let mask = espalier_volume::read_mask(mask, &options, &params)?.mask;
    let as_it_is = espalier_volume::Params {
        method: espalier_volume::Method::Mask,
        components: espalier_volume::Components::All,
        fill_cavities: false,
        close_tunnels: false,
        thick_slices: 0.0,
        ..params
    };
    let peer = espalier_volume::read_mask(peer, &options, &as_it_is)?.mask;
    Ok((tree_of(&mask, Root::Superior)?.tree, peer))
}
