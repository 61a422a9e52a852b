//! NIfTI-1 out: `.nii.gz` bytes of masks and volumes.
