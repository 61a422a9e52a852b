//! The figure of the organ in space beside its map: `space.png` and `space.svg`.
//!
//! **Input** tree, views and embedding, and the mask where the tree was made from one. **Output** the files.
//! **Guarantees** whose each voxel is follows from mask and tree as they are written, as in `branches.nii.gz`, so a run that
//! begins here gives the same picture. Voxels of no branch are not shown: the map does not have them either.

use espalier_model::{Bits, Mask, Tree};
use espalier_render::{Organ, Params, SpaceSubject};

use crate::artifacts::Artifacts;
use crate::error::Error;
use crate::page;
use crate::steps::Step;

/// Draws the figure; the subject's organ is looked for here.
pub(crate) fn figure(
    step: &mut Step<'_>,
    subject: &SpaceSubject<'_>,
    params: &Params,
) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let mask = if page::has_mask(step) { Some(step.take(Artifacts::mask)?) } else { None };
    let owned = mask.as_deref().map(|mask| owned(mask, subject.tree));
    let organ = mask.as_deref().zip(owned.as_ref()).map(|(mask, (bits, branches))| Organ {
        grid: mask.grid(),
        bits,
        branches,
    });
    let figure = espalier_render::space(&SpaceSubject { organ, ..*subject }, params)
        .map_err(|error| step.failed(error))?;
    Ok(vec![("space.png".to_owned(), figure.png), ("space.svg".to_owned(), figure.svg.into_bytes())])
}

/// The voxels of branches, and the branch of each plus 1.
fn owned(mask: &Mask, tree: &Tree) -> (Bits, Vec<u32>) {
    let values = espalier_tree::branch_voxels(mask, tree);
    let mut bits = Bits::new(mask.grid().shape());
    let owned = || mask.voxels().zip(&values).filter(|(_, value)| **value > 0);
    owned().for_each(|(voxel, _)| bits.set(voxel));
    (bits, owned().map(|(_, value)| *value).collect())
}
