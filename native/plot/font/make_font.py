#!/usr/bin/env python3
"""Writes sans_regular.cpp and sans_bold.cpp beside this file: the printable ASCII of DejaVu Sans as arrays.

It runs by hand, where the fonts or the letters change; the build needs the arrays alone. Packages: python3-fonttools,
fonts-dejavu-core.
"""
import io
import pathlib

from fontTools import subset
from fontTools.ttLib import TTFont

FONTS = pathlib.Path('/usr/share/fonts/truetype/dejavu')
LETTERS = range(0x20, 0x7f)
HEAD = '''\
// Written by make_font.py: printable ASCII of {font}, without hints. Do not edit.
//
// Copyright (c) 2003 by Bitstream, Inc. All Rights Reserved. Bitstream Vera is a trademark of
// Bitstream, Inc. DejaVu changes are in public domain. Permission is hereby granted, free of charge,
// to any person obtaining a copy of the fonts accompanying this license ("Fonts") and associated
// documentation files (the "Font Software"), to reproduce and distribute the Font Software,
// including without limitation the rights to use, copy, merge, publish, distribute, and/or sell
// copies of the Font Software, and to permit persons to whom the Font Software is furnished to do
// so, subject to the following conditions: The above copyright and trademark notices and this
// permission notice shall be included in all copies of one or more of the Font Software typefaces.
// The Font Software may be modified, altered, or added to, and in particular the designs of glyphs
// or characters in the Fonts may be modified and additional glyphs or characters may be added to
// the Fonts, only if the fonts are renamed to names not containing either the words "Bitstream" or
// the word "Vera". This License becomes null and void to the extent applicable to Fonts or Font
// Software that has been modified and is distributed under the "Bitstream Vera" names. The Font
// Software may be sold as part of a larger software package but no copy of one or more of the Font
// Software typefaces may be sold by itself. THE FONT SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY
// OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO ANY WARRANTIES OF MERCHANTABILITY,
// FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT OF COPYRIGHT, PATENT, TRADEMARK, OR OTHER
// RIGHT. IN NO EVENT SHALL BITSTREAM OR THE GNOME FOUNDATION BE LIABLE FOR ANY CLAIM, DAMAGES OR
// OTHER LIABILITY, INCLUDING ANY GENERAL, SPECIAL, INDIRECT, INCIDENTAL, OR CONSEQUENTIAL DAMAGES,
// WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM, OUT OF THE USE OR INABILITY TO
// USE THE FONT SOFTWARE OR FROM OTHER DEALINGS IN THE FONT SOFTWARE.
#include "plot/font/font_data.h"

namespace stipple {{

// clang-format off
const std::array<unsigned char, {size}> {name} = {{{{
'''
FOOT = '''\
}};
// clang-format on

}  // namespace stipple
'''


def letters_of(font):
    """The bytes of a TrueType font that holds the letters, their widths and their kerning alone."""
    options = subset.Options()
    options.hinting = False
    options.layout_features = []
    options.legacy_kern = True
    options.name_IDs = []
    options.notdef_outline = False
    options.glyph_names = False
    options.drop_tables += ['GPOS', 'GSUB', 'GDEF', 'FFTM', 'post', 'OS/2', 'name', 'gasp']
    made = TTFont(font, recalcTimestamp=False)
    subsetter = subset.Subsetter(options)
    subsetter.populate(unicodes=LETTERS)
    subsetter.subset(made)
    stream = io.BytesIO()
    made.save(stream, reorderTables=True)
    return stream.getvalue()


def lines_of(data):
    line = '   '
    for value in data:
        if len(line) + len(f' {value},') > 100:
            yield line
            line = '   '
        line += f' {value},'
    yield line


def main():
    here = pathlib.Path(__file__).resolve().parent
    sizes = {}
    for font, name in (('DejaVuSans', 'kSansRegular'), ('DejaVuSans-Bold', 'kSansBold')):
        data = letters_of(FONTS / f'{font}.ttf')
        sizes[name] = len(data)
        text = HEAD.format(font=font, size=len(data), name=name) + '\n'.join(lines_of(data)) + '\n' + FOOT
        (here / f'sans_{name[5:].lower()}.cpp').write_text(text, encoding='utf-8')
    print(sizes)


if __name__ == '__main__':
    main()
