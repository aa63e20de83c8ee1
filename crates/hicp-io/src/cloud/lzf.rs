//! LZF decompression, which PCD files use. The crates for it are deprecated.

/// Decompresses data into exactly `length` bytes, or returns `None` if they are damaged.
pub(super) fn decompress(mut data: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut output = Vec::with_capacity(length);
    while let Some((control, rest)) = data.split_first() {
        data = rest;
        let control = usize::from(*control);
        if control < 32 {
            // A run of bytes.
            let (run, rest) = data.split_at_checked(control + 1)?;
            output.extend_from_slice(run);
            data = rest;
        } else {
            // A copy of earlier output, which may overlap with what it writes.
            let mut count = control >> 5;
            let mut next = || {
                let (byte, rest) = data.split_first()?;
                data = rest;
                Some(usize::from(*byte))
            };
            if count == 7 {
                count += next()?;
            }
            let back = ((control & 31) << 8) + next()? + 1;
            let start = output.len().checked_sub(back)?;
            for index in start..start + count + 2 {
                output.push(output[index]);
            }
        }
        if output.len() > length {
            return None;
        }
    }
    (output.len() == length).then_some(output)
}
