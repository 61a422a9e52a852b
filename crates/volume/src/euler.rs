//! The Euler number of a mask, and with it its tunnels.
//!
//! **Input** [`Bits`], a 26-connected foreground. **Output** χ = components − tunnels + cavities.
//! **Steps** what [`Bits::euler_between`] says of each pair of slices, in parallel.
//! **Guarantees** exact; the same at any number of threads.
//! **Cost** a few operations a word.

use espalier_model::Bits;
use rayon::prelude::*;

/// [`Bits::euler_number`], by all threads.
pub(crate) fn euler_number(bits: &Bits) -> i64 {
    (0..=bits.shape()[2]).into_par_iter().map(|z| bits.euler_between(z)).sum()
}
