//! EXR images: one channel of a flat image.

use std::io::Cursor;
use std::path::Path;

use exr::meta::BlockDescription;
use exr::prelude::{MetaData, ReadChannels, ReadLayers, ReadSpecificChannel, Text, Vec2, read};

use super::raster::{Raster, check_size};
use crate::error::IoError;
use crate::limits::ReadLimits;

/// The names of channels with depth. The first that a file has counts.
const NAMES: [&str; 5] = ["Z", "depth", "V", "Y", "R"];

/// Decodes the channel of depth, or the only channel.
pub(super) fn decode(limits: &ReadLimits, path: &Path, content: &[u8]) -> Result<Raster, IoError> {
    let failed = |error: exr::error::Error| {
        let found = "data that are not a complete EXR image";
        IoError::new(path, None, found, "an EXR image without deep data").with_source(error)
    };
    let meta = MetaData::read_from_buffered(Cursor::new(content), false).map_err(failed)?;
    let names = meta.headers.iter().flat_map(|header| {
        let channels = header.channels.list.iter();
        channels.map(move |channel| (header, &channel.name))
    });
    let names: Vec<_> = names.collect();
    // Layers of a renderer come before the last dot: "ViewLayer.Depth.Z".
    let is = |text: &Text, wanted: &str| {
        let text = text.to_string();
        let last = text.rsplit('.').next();
        last.is_some_and(|last| last.eq_ignore_ascii_case(wanted))
    };
    let of_name = |wanted| names.iter().find(|(_, name)| is(name, wanted));
    let by_name = NAMES.into_iter().find_map(of_name);
    let Some((header, name)) = by_name.or(names.first().filter(|_| names.len() == 1)) else {
        let shown = names.iter().take(8).map(|(_, name)| format!("{name:?}"));
        let found = format!("the channels {}", shown.collect::<Vec<_>>().join(", "));
        let expected = "a channel `Z`, or a single channel";
        return Err(IoError::new(path, None, found, expected));
    };
    let (width, height) = (header.layer_size.x() as u64, header.layer_size.y() as u64);
    // The crate divides by the size of a tile, and counts with it before it checks anything.
    if let BlockDescription::Tiles(tiles) = header.blocks
        && tiles.tile_size.area() == 0
    {
        let found = format!("tiles of {:?} pixels", tiles.tile_size);
        return Err(IoError::new(path, None, found, "tiles with an area"));
    }
    let pixel_bytes = 2 * header.channels.list.len() as u64;
    let raw = width.saturating_mul(height).saturating_mul(pixel_bytes);
    let available = content.len() as u64;
    let size = check_size(limits, (path, 0), (width, height), raw, available)?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required((*name).clone())
        .collect_pixels(
            |size: Vec2<usize>, _| (size.x(), vec![0.0; size.area()]),
            |(width, samples), at, (sample,): (f32,)| samples[at.y() * *width + at.x()] = sample,
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(content))
        .map_err(failed)?;
    let (_, samples) = image.layer_data.channel_data.pixels;
    Ok(Raster::gray(size, None, samples))
}
